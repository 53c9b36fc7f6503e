"""Observations and rewards in units of their own spread, measured while learning."""

import dataclasses
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray, PyTree

from detpg.algorithms.parts import incremental
from detpg.types import (
    Action,
    Algorithm,
    EnvironmentSpec,
    Number,
    Observation,
    Transition,
    check_hyper,
    hyper,
    of_episode,
)

MOST = 10.0  # standard deviations: what lies further out is cut off
LEAST_VARIANCE = 1e-8
UNKNOWN = 1e18  # in place of a deviation; finite, also its square


class Moments(eqx.Module):
    """Mean and sum of squared deviations of what was seen so far (Welford, 1962)."""

    count: Number
    mean: Float[Array, "..."]
    squares: Float[Array, "..."]

    @classmethod
    def none(cls, shape: tuple[int, ...]) -> "Moments":
        """Before anything was seen."""
        return cls(jnp.zeros(()), jnp.zeros(shape), jnp.zeros(shape))

    def add(self, value: Float[Array, "..."]) -> "Moments":
        """With one more value."""
        count = self.count + 1
        deviation = value - self.mean
        mean = self.mean + deviation / count
        return Moments(count, mean, self.squares + deviation * (value - mean))

    @property
    def deviation(self) -> Float[Array, "..."]:
        """The standard deviation; immense before two values were seen, so that all counts 0."""
        variance = self.squares / jnp.maximum(self.count, 1.0)
        known = jnp.where(self.count < 2, jnp.full_like(variance, UNKNOWN**2), variance)
        return jnp.sqrt(known + LEAST_VARIANCE)


class NormalisedState(eqx.Module):
    """The learner's own state, what was seen of observations and returns, the return so far."""

    learner: PyTree
    observations: Moments
    returns: Moments
    discounted: Number = of_episode()


class Normalised(eqx.Module):
    """A learner that sees (s - mean) / deviation, and rewards over the deviation of returns.

    Mean and deviation are of all observations so far; a reward is divided by the deviation of the
    running discounted return, so that values are of the order of 1. Both are cut off at 10. A
    transition is seen in the units in which its action was drawn, and counted afterwards.

    Attributes:
        algorithm: The learner inside, of one transition per update.
        observation_size: d (static).
        observations: Whether observations are normalised (static).
        rewards: Whether rewards are (static).
        gamma: Discount of the running return.
    """

    equations: ClassVar[str] = "none: a wrapper"
    batch_size = incremental

    algorithm: Algorithm
    observation_size: int = eqx.field(static=True)
    observations: bool = eqx.field(static=True, default=True)
    rewards: bool = eqx.field(static=True, default=False)
    gamma: Number = hyper("discount of the running return", 0.99, 0.0, 1.0)

    def __check_init__(self):
        check_hyper(self)
        if self.algorithm.batch_size is not None:
            raise ValueError(
                f"The learner takes {self.algorithm.batch_size} transitions per update, but only "
                "one that takes one can be normalised: leave the normalisers out."
            )

    @classmethod
    def create(cls, spec: EnvironmentSpec, **options: Any) -> "Normalised":
        """The wrapper; `algorithm` is among the options."""
        return cls(observation_size=spec.observation_size, **options)

    def init(self, key: PRNGKeyArray) -> NormalisedState:
        learner = self.algorithm.init(key)
        seen, earned = Moments.none((self.observation_size,)), Moments.none(())
        return NormalisedState(learner, seen, earned, discounted=jnp.zeros(()))

    def act(self, key: PRNGKeyArray, state: NormalisedState, observation: Observation) -> Action:
        return self.algorithm.act(key, state.learner, self.seen(state, observation))

    def update(
        self, key: PRNGKeyArray, state: NormalisedState, transition: Transition
    ) -> tuple[NormalisedState, PyTree]:
        own = dataclasses.replace(
            transition,
            observation=self.seen(state, transition.observation),
            next_observation=self.seen(state, transition.next_observation),
            reward=self._earned(state, transition.reward),
        )
        learner, info = self.algorithm.update(key, state.learner, own)
        discounted = self.gamma * state.discounted + transition.reward
        after = NormalisedState(
            learner,
            state.observations.add(transition.observation),
            state.returns.add(discounted),
            jnp.where(transition.ended, jnp.zeros_like(discounted), discounted),
        )
        return after, info

    def greedy(self, state: NormalisedState, observation: Observation) -> Action:
        return self.algorithm.greedy(state.learner, self.seen(state, observation))

    def seen(self, state: NormalisedState, observation: Observation) -> Observation:
        """The observation as the learner inside sees it."""
        if not self.observations:
            return observation
        moments = state.observations
        return jnp.clip((observation - moments.mean) / moments.deviation, -MOST, MOST)

    def _earned(self, state: NormalisedState, reward: Number) -> Number:
        if not self.rewards:
            return reward
        return jnp.clip(reward / state.returns.deviation, -MOST, MOST)
