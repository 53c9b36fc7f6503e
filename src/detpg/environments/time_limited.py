"""Another time limit than the environment's own."""

import dataclasses

import equinox as eqx
from jaxtyping import Array, Bool, PRNGKeyArray, PyTree

from detpg.types import Action, Environment, EnvironmentSpec, Number, Observation


class TimeLimited(eqx.Module):
    """An environment whose episodes are cut after a number of steps.

    Attributes:
        environment: The environment inside.
        time_limit: Steps (static).
    """

    environment: Environment
    time_limit: int = eqx.field(static=True)

    def __check_init__(self):
        if self.time_limit < 1:
            raise ValueError(f"time_limit = {self.time_limit} is not usable: give 1 or more.")

    @property
    def spec(self) -> EnvironmentSpec:
        return dataclasses.replace(self.environment.spec, time_limit=self.time_limit)

    def initial(self, key: PRNGKeyArray) -> PyTree:
        return self.environment.initial(key)

    def transition(self, key: PRNGKeyArray, state: PyTree, action: Action) -> PyTree:
        return self.environment.transition(key, state, action)

    def reward(self, state: PyTree, action: Action, next_state: PyTree) -> Number:
        return self.environment.reward(state, action, next_state)

    def terminated(self, state: PyTree) -> Bool[Array, ""]:
        return self.environment.terminated(state)

    def observe(self, state: PyTree) -> Observation:
        return self.environment.observe(state)
