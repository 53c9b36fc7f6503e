"""Observations and rewards in units of their own spread, measured while learning."""

import dataclasses
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int32, PRNGKeyArray, PyTree

from detpg.experience import Experience, Recalled
from detpg.learning import recalling
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
from detpg.wrappers.sums import Sum

LARGEST = 5.0  # units of a normalised return, where rewards are recalled
MOST = 10.0  # standard deviations: what lies further out is cut off
# In place of deviations of 0 and of those that are not known: finite, as are their quotients with
# observations in any unit that float32 holds.
LEAST, UNKNOWN = 2.0**-120, 2.0**120
LONGEST = 2**31 - 1  # values after which the oldest begin to fade


class Moments(eqx.Module):
    """Mean and standard deviation of what was seen so far, in any unit (docs/decisions/0036).

    Attributes:
        count: Number of values, up to `LONGEST`; from there on each new one weighs as much as the
            last of those.
        centre: Their mean.
        spread: Their standard deviation, not its square, which would leave the range of float32.
    """

    count: Int32[Array, ""]
    centre: Sum
    spread: Sum

    @classmethod
    def none(cls, shape: tuple[int, ...]) -> "Moments":
        """Before anything was seen."""
        return cls.of(0, jnp.zeros(shape), jnp.zeros(shape))

    @classmethod
    def of(cls, count: int, mean: Float[Array, "..."], deviation: Float[Array, "..."]) -> "Moments":
        """As if that many values had been seen."""
        known = jnp.asarray(min(count, LONGEST), jnp.int32)
        return cls(known, Sum.of(mean), Sum.of(deviation))

    def add(self, value: Float[Array, "..."]) -> "Moments":
        """With one more value; its gain g is 1 / count.

        mean <- mean + g d, variance <- (1 - g) (variance + g d^2), where d = value - mean.
        """
        count = jnp.where(self.count < LONGEST, self.count + 1, self.count)
        gain = 1 / count.astype(value.dtype)
        away = (value - self.centre.value) - self.centre.rest
        spread = self.spread.add(_growth(self.spread.value, away, gain))
        return Moments(count, self.centre.add(gain * away), spread)

    @property
    def mean(self) -> Float[Array, "..."]:
        """The mean."""
        return self.centre.value

    @property
    def deviation(self) -> Float[Array, "..."]:
        """The standard deviation; immense before two values were seen, so that all counts 0.

        It is at least the rounding of the values themselves, so that what is constant but for its
        last bit stays small.
        """
        spread = self.spread.value
        rounding = jnp.finfo(spread.dtype).eps * jnp.abs(self.mean)
        known = jnp.maximum(jnp.maximum(spread, rounding), LEAST)
        return jnp.where(self.count < 2, jnp.full_like(spread, UNKNOWN), known)


def _growth(
    spread: Float[Array, "..."], away: Float[Array, "..."], gain: Number
) -> Float[Array, "..."]:
    """By how much the deviation grows with one more value, at that distance from the mean.

    sigma' - sigma = (sigma'^2 - sigma^2) / (sigma' + sigma), in units of the larger of sigma and
    the distance: no square leaves the range, and no difference of large numbers is taken.
    """
    unit = jnp.maximum(spread, jnp.abs(away))
    unit = jnp.where(unit == 0, jnp.ones_like(unit), unit)
    old, new = (spread / unit) ** 2, (away / unit) ** 2
    total = jnp.sqrt((1 - gain) * (old + gain * new)) + spread / unit
    known = jnp.where(total == 0, jnp.ones_like(total), total)
    return unit * (gain * ((1 - gain) * new - old) / known)


class NormalisedState(eqx.Module):
    """The learner's own state, what was seen of observations and returns, the return so far.

    `largest` is the largest discounted return so far, by its size.
    """

    learner: PyTree
    observations: Moments
    returns: Moments
    largest: Number
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

    algorithm: Algorithm
    observation_size: int = eqx.field(static=True)
    observations: bool = eqx.field(static=True, default=True)
    rewards: bool = eqx.field(static=True, default=False)
    gamma: Number = hyper("discount of the running return", 0.99, 0.0, 1.0)

    def __check_init__(self):
        check_hyper(self)
        if self.algorithm.experience.kind == "fresh":
            raise ValueError(
                f"The learner takes {self.algorithm.experience.batch} transitions per update, but "
                "only one that takes one can be normalised: leave the normalisers out."
            )

    @classmethod
    def create(cls, spec: EnvironmentSpec, **options: Any) -> "Normalised":
        """The wrapper; `algorithm` is among the options."""
        return cls(observation_size=spec.observation_size, **options)

    @property
    def experience(self) -> Experience:
        """That of the learner inside."""
        return self.algorithm.experience

    def init(self, key: PRNGKeyArray) -> NormalisedState:
        learner = self.algorithm.init(key)
        seen, earned = Moments.none((self.observation_size,)), Moments.none(())
        return NormalisedState(learner, seen, earned, jnp.zeros(()), discounted=jnp.zeros(()))

    def act(self, key: PRNGKeyArray, state: NormalisedState, observation: Observation) -> Action:
        return self.algorithm.act(key, state.learner, self.seen(state, observation))

    def update(
        self, key: PRNGKeyArray, state: NormalisedState, transition: Transition | Recalled
    ) -> tuple[NormalisedState, PyTree]:
        learner, info = self.algorithm.update(key, state.learner, self._own(state, transition))
        after = dataclasses.replace(state, learner=learner)
        if isinstance(transition, Recalled):  # it was counted when it happened
            return after, info
        return _counted(self, after, transition), info

    def roam(self, key: PRNGKeyArray, state: NormalisedState, observation: Observation) -> Action:
        return recalling(self.algorithm).roam(key, state.learner, self.seen(state, observation))

    def follow(
        self, key: PRNGKeyArray, state: NormalisedState, transition: Transition
    ) -> NormalisedState:
        own = self._own(state, transition)
        learner = recalling(self.algorithm).follow(key, state.learner, own)
        return _counted(self, dataclasses.replace(state, learner=learner), transition)

    def greedy(self, state: NormalisedState, observation: Observation) -> Action:
        return self.algorithm.greedy(state.learner, self.seen(state, observation))

    def seen(self, state: NormalisedState, observation: Observation) -> Observation:
        """The observation as the learner inside sees it."""
        if not self.observations:
            return observation
        moments = state.observations
        return jnp.clip((observation - moments.mean) / moments.deviation, -MOST, MOST)

    def _own(self, state: NormalisedState, transition: Any) -> Any:
        """A transition, or a batch of recalled ones, in the units of the learner inside."""
        many = isinstance(transition, Recalled)
        name, seen = ("rewards", jax.vmap(self.seen, (None, 0))) if many else ("reward", self.seen)
        return dataclasses.replace(
            transition,
            observation=seen(state, transition.observation),
            next_observation=seen(state, transition.next_observation),
            **{name: self._earned(state, getattr(transition, name))},
        )

    def _earned(self, state: NormalisedState, reward: Float[Array, "..."]) -> Float[Array, "..."]:
        if not self.rewards:
            return reward
        return jnp.clip(reward / self.unit(state), -MOST, MOST)

    def unit(self, state: NormalisedState) -> Number:
        """What 1 of a normalised reward is: the deviation of returns.

        For a learner that recalls it is at least a fifth of the largest return, as in SimbaV2 (Lee
        et al., 2025).
        """
        deviation = state.returns.deviation
        if self.experience.kind != "recalled":
            return deviation
        return jnp.maximum(deviation, state.largest / LARGEST)


def _counted(
    learner: Normalised, state: NormalisedState, transition: Transition
) -> NormalisedState:
    """With what was seen of one more transition, in raw units."""
    discounted = learner.gamma * state.discounted + transition.reward
    return NormalisedState(
        state.learner,
        state.observations.add(transition.observation),
        state.returns.add(discounted),
        jnp.maximum(state.largest, jnp.abs(discounted)),
        jnp.where(transition.ended, jnp.zeros_like(discounted), discounted),
    )
