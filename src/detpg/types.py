"""The vocabulary of the walk: the transition, the protocols of its stops, and hyper-parameters.

All quantities are unbatched; batching over seeds and hyper-parameters is a `jax.vmap` outside.
Axis names used in annotations: `obs act feat points seeds time batch`.
"""

import dataclasses
import math
from typing import Any, ClassVar, Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float, PRNGKeyArray, PyTree, Shaped

from detpg.bounds import Bounds as Bounds
from detpg.bounds import EnvironmentSpec as EnvironmentSpec
from detpg.experience import Experience

Number = Float[Array, ""]
Width = Float[Array, "..."]  # one number, or one for each action component
Observation = Float[Array, "obs"]
Action = Float[Array, "act"]


class Transition(eqx.Module):
    """One step of experience, (s, a, r, s', a').

    `next_observation` is the one before any reset; `next_action` what the learner would do there,
    drawn before it learns from this transition (with correlated noise, from the deviation one step
    earlier: docs/decisions/0015). `terminated` stops bootstrapping. `truncated`
    (false unless given) says that a time limit cut the episode here: s' is bootstrapped from, but
    what a learner carries from step to step, traces and correlated noise, ends. What is not finite
    in s' and a' becomes 0 where `terminated`. A batch learner of fresh episodes receives the same
    record with a leading axis `batch` on every field.
    """

    observation: Float[Array, "*batch obs"]
    action: Float[Array, "*batch act"]
    reward: Float[Array, "*batch"]
    next_observation: Float[Array, "*batch obs"]
    next_action: Float[Array, "*batch act"]
    terminated: Bool[Array, "*batch"]
    truncated: Bool[Array, "*batch"]

    def __init__(
        self,
        observation: Float[Array, "*batch obs"],
        action: Float[Array, "*batch act"],
        reward: Float[Array, "*batch"],
        next_observation: Float[Array, "*batch obs"],
        next_action: Float[Array, "*batch act"],
        terminated: Bool[Array, "*batch"],
        truncated: Bool[Array, "*batch"] | None = None,
    ):
        """One step, or a batch of them."""
        self.observation, self.action, self.reward = observation, action, reward
        self.next_observation = _finite_where(terminated, next_observation)
        self.next_action = _finite_where(terminated, next_action)
        self.terminated = terminated
        self.truncated = jnp.zeros_like(terminated) if truncated is None else truncated

    @property
    def ended(self) -> Bool[Array, "*batch"]:
        """Whether the next transition belongs to another episode."""
        return self.terminated | self.truncated


def _finite_where(terminated: Bool[Array, "*batch"], end: Array) -> Array:
    """What stands at a true end, where a world may leave NaN: 0 * NaN would reach the learner."""
    unfit = terminated[..., None] & ~jnp.isfinite(end)
    return jnp.where(unfit, jnp.zeros_like(end), end)


@runtime_checkable
class Environment(Protocol):
    """p_1, p and r of Section 2.1: a frozen record whose physical constants are leaves."""

    @property
    def spec(self) -> EnvironmentSpec: ...

    def initial(self, key: PRNGKeyArray) -> PyTree: ...

    def transition(self, key: PRNGKeyArray, state: PyTree, action: Action) -> PyTree: ...

    def reward(self, state: PyTree, action: Action, next_state: PyTree) -> Number: ...

    def terminated(self, state: PyTree) -> Bool[Array, ""]: ...

    def observe(self, state: PyTree) -> Observation: ...


@runtime_checkable
class Policy(Protocol):
    """mu_theta(s). The object is structure, theta (any pytree) is data."""

    def init(self, key: PRNGKeyArray) -> PyTree: ...

    def __call__(self, theta: PyTree, observation: Observation) -> Action: ...


@runtime_checkable
class StochasticPolicy(Protocol):
    """pi_{theta,y}(a|s): a policy (its mean) that can also be sampled and has a density."""

    def init(self, key: PRNGKeyArray) -> PyTree: ...

    def __call__(self, theta: PyTree, observation: Observation) -> Action: ...

    def sample(self, key: PRNGKeyArray, theta: PyTree, observation: Observation) -> Action: ...

    def log_prob(self, theta: PyTree, observation: Observation, action: Action) -> Number: ...


@runtime_checkable
class Features(Protocol):
    """x(s), what a function is linear in. Structure without parameters."""

    @property
    def size(self) -> int: ...

    def __call__(self, observation: Observation) -> Float[Array, "feat"]: ...


@runtime_checkable
class ActionValue(Protocol):
    """Q^w(s, a), differentiable in w and a. The object is structure, w (any pytree) is data."""

    def init(self, key: PRNGKeyArray) -> PyTree: ...

    def __call__(self, w: PyTree, observation: Observation, action: Action) -> Number: ...


@runtime_checkable
class ActionValues(Protocol):
    """Q_1 ... Q_K as one function of one tree w; `first` is Q_1 alone, without the cost of all."""

    def init(self, key: PRNGKeyArray) -> PyTree: ...

    def __call__(self, w: PyTree, observation: Observation, action: Action) -> Array: ...

    def first(self, w: PyTree, observation: Observation, action: Action) -> Number: ...


@runtime_checkable
class StateValue(Protocol):
    """V^v(s), differentiable in v: the baseline of the compatible critic."""

    def init(self, key: PRNGKeyArray) -> PyTree: ...

    def __call__(self, v: PyTree, observation: Observation) -> Number: ...


@runtime_checkable
class Behaviour(Protocol):
    """beta(a|s): how actions are chosen while learning."""

    def act(self, key: PRNGKeyArray, theta: PyTree, observation: Observation) -> Action: ...

    def log_prob(self, theta: PyTree, observation: Observation, action: Action) -> Number: ...


@runtime_checkable
class Algorithm(Protocol):
    """A learner: structure is static, hyper-parameters are leaves, State is what `update` needs.

    `experience` says what it learns from; the loops read it and nothing else of a learner.
    `equations` names the paper's lines. A learner that recalls has two functions more, `roam` and
    `follow` (`detpg.learning.Recalling`), and its `update` takes a `detpg.experience.Recalled`.
    """

    equations: ClassVar[str]

    @classmethod
    def create(cls, spec: EnvironmentSpec, **options: Any) -> "Algorithm": ...

    @property
    def experience(self) -> Experience: ...

    def init(self, key: PRNGKeyArray) -> PyTree: ...

    def act(self, key: PRNGKeyArray, state: PyTree, observation: Observation) -> Action: ...

    def update(
        self,
        key: PRNGKeyArray,
        state: PyTree,
        transition: Any,  # a Transition, or a Recalled of a learner that recalls
    ) -> tuple[PyTree, PyTree]: ...

    def greedy(self, state: PyTree, observation: Observation) -> Action: ...


@dataclasses.dataclass(frozen=True)
class Hyper:
    """What is known of a hyper-parameter: the one source for help, docs, sweeps and validation."""

    doc: str
    default: float
    low: float
    high: float


def strong(value: Any) -> Shaped[Array, "..."]:
    """A strongly typed float array: a weakly typed one breaks scan carries and retraces."""
    if isinstance(value, jax.Array) and jnp.issubdtype(value.dtype, jnp.floating):
        return value.astype(value.dtype)
    return jnp.asarray(value, dtype=float)


def of_episode() -> Any:
    """A field of a learner's state that belongs to the episode at hand: a trace, a deviation.

    Of a learner that lives in several worlds each of them has one; all else is shared.
    """
    return eqx.field(metadata={"of_episode": True})


def hyper(doc: str, default: float, low: float, high: float) -> Any:
    """A real-valued hyper-parameter as a field: an array leaf with its documentation and range.

    Args:
        doc: One line, with the unit where there is one.
        default: Value when none is given.
        low: Least allowed value.
        high: Greatest allowed value.
    """
    known = Hyper(doc, default, low, high)
    return eqx.field(default=default, converter=strong, metadata={"hyper": known})


def switch(doc: str, default: bool | int | str) -> Any:
    """An option that is part of a learner's structure: a static field, bool, int or `Literal`.

    Args:
        doc: One line: what it does, or what the words or the number mean.
        default: Value when none is given.
    """
    return eqx.field(static=True, default=default, metadata={"switch": doc})


def switches(record: Any) -> dict[str, Any]:
    """Fields made by `switch`, of a record or its class; `metadata["switch"]` says what it does."""
    return {f.name: f for f in dataclasses.fields(record) if "switch" in f.metadata}


def hyper_parameters(record: Any) -> dict[str, Hyper]:
    """The hyper-parameters of a record or of its class, in order of declaration."""
    fields = dataclasses.fields(record)
    return {f.name: f.metadata["hyper"] for f in fields if "hyper" in f.metadata}


def check_hyper(record: Any) -> None:
    """Refuses a hyper-parameter that is not finite, outside its range or of the wrong shape.

    It is one number; only a `Width` may be a vector. Of a traced value the shape alone is looked
    at: inside `jit` or `vmap` there is no number.

    Raises:
        ValueError: Names the value or shape, the range and the hyper-parameter.
    """
    annotations = {field.name: field.type for field in dataclasses.fields(record)}
    for name, known in hyper_parameters(record).items():
        value, is_width = getattr(record, name), annotations[name] is Width
        if np.ndim(value) > is_width:
            needed = "one number for each action component" if is_width else "one number"
            raise ValueError(
                f"{name} has shape {np.shape(value)}: give {needed} ({known.doc}); map over a grid "
                "with jax.vmap."
            )
        if isinstance(value, Tracer):
            continue
        for number in np.ravel(np.asarray(value)):
            if not (math.isfinite(number) and known.low <= number <= known.high):
                raise ValueError(
                    f"{name} = {number:g} is not usable: give a finite number between "
                    f"{known.low:g} and {known.high:g} ({known.doc})."
                )
