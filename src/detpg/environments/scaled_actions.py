"""Actions in units of their legal range: the learner's 1 is the environment's bound."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, PRNGKeyArray, PyTree

from detpg.types import Action, Environment, EnvironmentSpec, Number, Observation


class ScaledActions(eqx.Module):
    """An environment whose legal actions are [-1, 1] in each component that has bounds.

    An action is mapped affinely to the range of the environment inside: -1 to its lower bound, 1 to
    its upper bound; what lies outside goes on along the same line, and the environment cuts it off.
    Step sizes and the width of the behaviour then have one meaning in all environments. A component
    without both bounds has no such unit, and keeps its own.

    Attributes:
        environment: The environment inside.
    """

    environment: Environment

    @property
    def spec(self) -> EnvironmentSpec:
        spec = self.environment.spec
        low, high = spec.bounds.scaled
        return dataclasses.replace(spec, action_low=low, action_high=high)

    def legal(self, action: Action) -> Action:
        """The action in the units of the environment inside."""
        bounds = self.environment.spec.bounds
        centre, half = (jnp.asarray(x, action.dtype) for x in (bounds.centre, bounds.half_range))
        return centre + half * action

    def initial(self, key: PRNGKeyArray) -> PyTree:
        return self.environment.initial(key)

    def transition(self, key: PRNGKeyArray, state: PyTree, action: Action) -> PyTree:
        return self.environment.transition(key, state, self.legal(action))

    def reward(self, state: PyTree, action: Action, next_state: PyTree) -> Number:
        return self.environment.reward(state, self.legal(action), next_state)

    def terminated(self, state: PyTree) -> Bool[Array, ""]:
        return self.environment.terminated(state)

    def observe(self, state: PyTree) -> Observation:
        return self.environment.observe(state)
