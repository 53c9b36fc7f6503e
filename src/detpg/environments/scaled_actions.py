"""Actions in units of their legal range: the learner's 1 is the environment's bound."""

import dataclasses
import math

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, PRNGKeyArray, PyTree

from detpg.types import Action, Environment, EnvironmentSpec, Number, Observation


class ScaledActions(eqx.Module):
    """An environment whose legal actions are [-1, 1] in each component.

    An action is mapped affinely to the range of the environment inside: -1 to its lower bound, 1 to
    its upper bound; what lies outside goes on along the same line, and the environment cuts it off.
    Step sizes and the width of the behaviour then have one meaning in all environments.

    Attributes:
        environment: The environment inside, with bounded actions.
    """

    environment: Environment

    def __check_init__(self):
        spec = self.environment.spec
        if not all(map(math.isfinite, (*spec.action_low, *spec.action_high))):
            raise ValueError(
                f"The actions of {spec.name!r} have no bounds, so that there is no unit to scale "
                "them by: use the environment as it is."
            )

    @property
    def spec(self) -> EnvironmentSpec:
        ones = (1.0,) * self.environment.spec.action_size
        return dataclasses.replace(
            self.environment.spec, action_low=tuple(-x for x in ones), action_high=ones
        )

    def legal(self, action: Action) -> Action:
        """The action in the units of the environment inside."""
        spec = self.environment.spec
        low, high = (jnp.asarray(b, action.dtype) for b in (spec.action_low, spec.action_high))
        return (low + high) / 2 + (high - low) / 2 * action

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
