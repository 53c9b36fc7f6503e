"""What is deployed: observation in, action out, in the units of the user's world."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray, PyTree

from detpg.policies.behaviour import cap
from detpg.types import Action, Algorithm, Bounds, Observation


class Controller(eqx.Module):
    """Normaliser, policy, bounds and action scaling as one function.

    Attributes:
        algorithm: The learner, with its normaliser; acts in units of the box.
        learner: Its state.
        bounds: The box of legal actions in the world's units (static).
    """

    algorithm: Algorithm
    learner: PyTree
    bounds: Bounds = eqx.field(static=True)

    def __call__(self, observation: Observation) -> Action:
        return self._legal(self.algorithm.greedy(self.learner, observation))

    def explore(self, key: PRNGKeyArray, observation: Observation) -> Action:
        """An action with the noise that the learner explores with."""
        return self._legal(self.algorithm.act(key, self.learner, observation))

    def _legal(self, action: Action) -> Action:
        return in_world_units(cap(action, self.bounds.scaled), self.bounds)


def in_world_units(action: Action, bounds: Bounds) -> Action:
    """An action from units of the box to those of the world; never outside the box."""
    centre, half = (jnp.asarray(x, action.dtype) for x in (bounds.centre, bounds.half_range))
    # The cap is repeated: rounding may carry centre + half a last bit beyond the bound.
    return cap(centre + half * action, bounds)
