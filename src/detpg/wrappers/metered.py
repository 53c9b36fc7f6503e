"""What a run is watched by: returns, errors and warning signs, counted inside the compiled loop."""

import dataclasses
import operator
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PRNGKeyArray, PyTree

from detpg.experience import Experience, Recalled
from detpg.learning import recalling
from detpg.types import (
    Action,
    Algorithm,
    Bounds,
    EnvironmentSpec,
    Number,
    Observation,
    Transition,
    of_episode,
)

# What became non-finite first; 0: nothing did.
QUANTITIES = ("nothing", "observation", "action", "reward", "next observation", "TD error")
SUMS = (
    "steps",
    "episodes",
    "returns",
    "lengths",
    "updates",
    "squared_errors",
    "values",
    "saturated",
    "deviations",
)
WHOLE = ("fault", "fault_step", "age")
EDGE = 1e-3  # of the half range: an action this near to a bound counts as on it


class Meter(eqx.Module):
    """Sums since they were last read, and the episode so far.

    Attributes:
        steps: Number of transitions.
        episodes: Number of episodes that ended.
        returns: Sum of their undiscounted returns.
        lengths: Sum of their steps.
        updates: Number of updates: one for each transition, but for a learner that recalls.
        squared_errors: Sum of delta^2.
        values: Sum of the critic's values.
        saturated: Sum of the shares of mean-action components on a bound.
        deviations: Sum of |a - mu_theta(s)|^2 / m, half ranges.
        fault: Index in `QUANTITIES` of what became non-finite first, and so many times their number
            as its component.
        fault_step: Number of transitions before that, of the whole run.
        age: Number of transitions of the whole run.
        episode_return: Of the episode so far.
        episode_length: Of the episode so far.
    """

    steps: Number
    episodes: Number
    returns: Number
    lengths: Number
    updates: Number
    squared_errors: Number
    values: Number
    saturated: Number
    deviations: Number
    fault: Int[Array, ""]
    fault_step: Int[Array, ""]
    age: Int[Array, ""]
    episode_return: Number = of_episode()
    episode_length: Number = of_episode()

    @classmethod
    def new(cls) -> "Meter":
        """Nothing seen."""
        zeros = dict.fromkeys(cls.__dataclass_fields__, jnp.zeros(()))
        return cls(**zeros | dict.fromkeys(WHOLE, jnp.asarray(0, dtype=int)))

    def read(self) -> "Meter":
        """The meter after it was read: sums are zero again, the episode and the faults stay.

        Many meters at once are read likewise, whatever axes they have.
        """
        sums = operator.attrgetter(*SUMS)
        return eqx.tree_at(sums, self, replace_fn=jnp.zeros_like)


class MeteredState(eqx.Module):
    """The learner's own state, and the meter."""

    learner: PyTree
    meter: Meter


class Metered(eqx.Module):
    """A learner whose state counts what it earns and shows; it learns what it learnt without.

    Attributes:
        algorithm: The learner inside, of one transition per update.
        bounds: Of the actions, as the learner sees them (static).
    """

    equations: ClassVar[str] = "none: a wrapper"

    algorithm: Algorithm
    bounds: Bounds = eqx.field(static=True)

    @classmethod
    def create(cls, spec: EnvironmentSpec, **options: Any) -> "Metered":
        """The wrapper; `algorithm` is among the options."""
        return cls(bounds=spec.bounds, **options)

    @property
    def experience(self) -> Experience:
        """That of the learner inside."""
        return self.algorithm.experience

    def init(self, key: PRNGKeyArray) -> MeteredState:
        return MeteredState(self.algorithm.init(key), Meter.new())

    def act(self, key: PRNGKeyArray, state: MeteredState, observation: Observation) -> Action:
        return self.algorithm.act(key, state.learner, observation)

    def update(
        self, key: PRNGKeyArray, state: MeteredState, transition: Transition | Recalled
    ) -> tuple[MeteredState, PyTree]:
        learner, info = self.algorithm.update(key, state.learner, transition)
        if isinstance(transition, Recalled):
            return MeteredState(learner, _learnt(state.meter, info)), info
        meter = self._lived(state, transition)
        return MeteredState(learner, _learnt(meter, info)), info

    def roam(self, key: PRNGKeyArray, state: MeteredState, observation: Observation) -> Action:
        return recalling(self.algorithm).roam(key, state.learner, observation)

    def follow(
        self, key: PRNGKeyArray, state: MeteredState, transition: Transition
    ) -> MeteredState:
        learner = recalling(self.algorithm).follow(key, state.learner, transition)
        return MeteredState(learner, self._lived(state, transition))

    def greedy(self, state: MeteredState, observation: Observation) -> Action:
        return self.algorithm.greedy(state.learner, observation)

    def _lived(self, state: MeteredState, transition: Transition) -> Meter:
        """With one more transition of the world."""
        meter, mean = state.meter, self.algorithm.greedy(state.learner, transition.observation)
        half, low, high = (
            jnp.asarray(end, mean.dtype) for end in (self.bounds.half_range, *self.bounds)
        )
        on_bound = (mean <= low + EDGE * half) | (mean >= high - EDGE * half)
        total = meter.episode_return + transition.reward
        length = meter.episode_length + 1
        ended = transition.ended.astype(total.dtype)
        lived = dataclasses.replace(
            meter,
            steps=meter.steps + 1,
            episodes=meter.episodes + ended,
            returns=meter.returns + ended * total,
            lengths=meter.lengths + ended * length,
            saturated=meter.saturated + jnp.mean(on_bound.astype(total.dtype)),
            deviations=meter.deviations + jnp.mean(((transition.action - mean) / half) ** 2),
            age=meter.age + 1,
            episode_return=total * (1 - ended),
            episode_length=length * (1 - ended),
        )
        t = transition
        return _told(lived, t.observation, t.action, t.reward, t.next_observation)


def _learnt(meter: Meter, info: Any) -> Meter:
    """With one more update."""
    learnt = dataclasses.replace(
        meter,
        updates=meter.updates + 1,
        squared_errors=meter.squared_errors + info.delta**2,
        values=meter.values + info.value,
    )
    return _told(learnt, info.delta, first=len(QUANTITIES) - 1)


def _told(meter: Meter, *seen: Float[Array, "..."], first: int = 1) -> Meter:
    """With the first of some `QUANTITIES` that is not finite, its component and its step."""
    finite = [jnp.atleast_1d(jnp.isfinite(x)) for x in seen]
    kind = jnp.argmin(jnp.stack([jnp.all(fine) for fine in finite]))
    component = jnp.stack([jnp.argmin(fine) for fine in finite])[kind]
    fault = (kind + first + len(QUANTITIES) * component).astype(meter.fault.dtype)
    new = (meter.fault == 0) & ~jnp.all(jnp.concatenate(finite))
    return dataclasses.replace(
        meter,
        fault=jnp.where(new, fault, meter.fault),
        fault_step=jnp.where(new, meter.age - 1, meter.fault_step),
    )
