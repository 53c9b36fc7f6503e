"""What turns what the host's worlds returned into the next actions: one compiled call a step."""

import functools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Protocol

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Float, Int, Key, PRNGKeyArray, PyTree

from detpg import trees
from detpg.learning import choose, learn, recalling
from detpg.machine import cores
from detpg.memory import Memory, remember
from detpg.training import StepKeys
from detpg.types import Action, Algorithm, Transition
from detpg.workbench.lanes import joined, lane
from detpg.wrappers import of_each_world


class HostState(eqx.Module):
    """What is kept of a run; the worlds themselves cannot be.

    Attributes:
        learner: Seeds first; what belongs to an episode has an axis of worlds after it.
        observation: Where the worlds stand.
        action: Chosen there, as drawn, in units of the box.
        steps: Taken by each learner.
        memory: Of each learner that recalls, one after the other.
    """

    learner: PyTree
    observation: Float[Array, "*seeds worlds obs"]
    action: Float[Array, "*seeds worlds act"]
    steps: Int[Array, "*seeds"]
    memory: Any = None


Carry = Callable[[Action], Action]


class Driver(Protocol):
    """Learners on their way: takes what the worlds returned, gives what is carried out next."""

    @property
    def state(self) -> HostState: ...

    def __call__(self, seen: Float[np.ndarray, "seeds worlds columns"]) -> np.ndarray: ...


class Together:
    """All learners in one program, side by side."""

    def __init__(self, program: Any, keys: Key[Array, "seeds"], state: HostState):
        """Takes the learners where they stand."""
        # The leaves go in and out by themselves: to flatten records at each step costs as much time
        # as a step of a small world.
        self._leaves, self._structure = jax.tree.flatten(state)
        self._program, self._keys = program, keys

    @property
    def state(self) -> HostState:
        """Where they stand now."""
        return jax.tree.unflatten(self._structure, self._leaves)

    def __call__(self, seen: np.ndarray) -> np.ndarray:
        self._leaves, chosen = self._program(self._structure, self._keys, self._leaves, seen)
        return np.asarray(chosen).reshape(-1, chosen.shape[-1])


class Apart:
    """Each learner in a program of its own, to which its memory is given away; on all cores."""

    def __init__(self, program: Any, keys: Key[Array, "seeds"], state: HostState):
        """Takes the learners where they stand."""
        lanes = [jax.tree.flatten(lane(state, i)) for i in range(len(keys))]
        self._leaves, (self._structure, *_) = (list(x) for x in zip(*lanes))
        self._program, self._keys = program, list(keys)
        self._threads = ThreadPoolExecutor(cores()) if len(lanes) > 1 else None

    @property
    def state(self) -> HostState:
        """Where they stand at last; none is under way any more."""
        if self._threads is not None:
            self._threads.shutdown()
        return joined([jax.tree.unflatten(self._structure, leaves) for leaves in self._leaves])

    def __call__(self, seen: np.ndarray) -> np.ndarray:
        def one(i: int) -> np.ndarray:
            self._leaves[i], chosen = self._program(
                self._structure, self._keys[i], self._leaves[i], seen[i]
            )
            return np.asarray(chosen)

        numbers = range(len(self._leaves))
        run = map if self._threads is None else self._threads.map
        return np.concatenate(list(run(one, numbers)))


def together(learner: Algorithm, carried_out: Carry) -> Any:
    """The program of `Together`."""

    @functools.partial(jax.jit, static_argnums=0)
    def program(structure: Any, keys: Any, leaves: list[Array], seen: Array) -> Any:
        state = jax.tree.unflatten(structure, leaves)
        after = jax.vmap(functools.partial(_step, learner))(keys, state, seen)
        return jax.tree.leaves(after), jax.vmap(jax.vmap(carried_out))(after.action)

    return program


def apart(learner: Algorithm, carried_out: Carry) -> Any:
    """The program of `Apart`; what goes in is given away, the memory is written in place."""

    @functools.partial(jax.jit, static_argnums=0, donate_argnums=2)
    def program(structure: Any, key: Any, leaves: list[Array], seen: Array) -> Any:
        after = _step(learner, key, jax.tree.unflatten(structure, leaves), seen)
        return jax.tree.leaves(after), jax.vmap(carried_out)(after.action)

    return program


def act(
    learner: Algorithm,
    key: PRNGKeyArray,
    state: PyTree,
    observation: Float[Array, "worlds obs"],
    step: Int[Array, ""],
) -> Float[Array, "worlds act"]:
    """The first action of each world, when `step` steps were taken."""
    keys = _step_keys(key, step, observation.shape[0])
    unused = StepKeys._fields.index("environment")  # by a world of the host
    return _acts(learner, keys[:, unused], *_parted(state), observation, step)


def _step(
    learner: Algorithm,
    key: PRNGKeyArray,
    state: HostState,
    seen: Float[Array, "worlds columns"],
) -> HostState:
    """Learns from the worlds one after another, then chooses an action in each."""
    worlds, size = state.observation.shape
    keys = _step_keys(key, state.steps, worlds)
    recalls = state.memory is not None
    own, shared = _parted(state.learner)

    def body(shared: PyTree, world: Any) -> tuple[PyTree, PyTree]:
        own, key, observation, action, seen = world
        stream, before = StepKeys(*key), eqx.combine(own, shared)
        next_observation = seen[:size]
        transition = Transition(
            observation,
            action,
            reward=seen[-4],
            next_observation=next_observation,
            next_action=action
            if recalls
            else learner.act(stream.behaviour, before, next_observation),
            terminated=seen[-3] > 0,
            truncated=seen[-2] > 0,
        )
        if recalls:
            after = recalling(learner).follow(stream.update, before, transition)
        else:
            after, _ = learner.update(stream.update, before, transition)
        # A call that only reset a world brought nothing to learn from.
        own, shared = _parted(trees.where(seen[-1] > 0, after, before))
        return shared, (own, transition)

    rows = own, keys, state.observation, state.action, seen
    shared, (own, transitions) = jax.lax.scan(body, shared, rows)
    steps, memory = state.steps + worlds, state.memory
    if memory is not None:
        memory = remember(memory, transitions, seen[:, -1] > 0)
        shared = _recalled(learner, keys[0], own, shared, memory, steps)
    start = seen[:, size : 2 * size]
    behaviour = StepKeys._fields.index("behaviour")
    chosen = _acts(learner, keys[:, behaviour], own, shared, start, steps)
    return HostState(eqx.combine(own, shared), start, chosen, steps, memory)


def _recalled(
    learner: Algorithm,
    keys: Key[Array, "4"],
    own: PyTree,
    shared: PyTree,
    memory: Memory,
    steps: Int[Array, ""],
) -> PyTree:
    """What the worlds share, after an update for each of them."""
    first = jax.tree.map(lambda leaf: leaf[0], own)
    ready = steps >= learner.experience.warm_up
    reset = StepKeys._fields.index("reset")  # of no use to a world of the host either
    state = eqx.combine(first, shared)
    after, _ = learn(learner, keys[reset], state, memory, ready, memory.added.shape[0])
    return _parted(after)[1]


def _parted(state: PyTree) -> tuple[PyTree, PyTree]:
    """What each world has, and what they share."""
    return eqx.partition(state, of_each_world(state))


def _step_keys(key: PRNGKeyArray, steps: Any, worlds: int) -> Key[Array, "worlds 4"]:
    """The streams of one step in each world, in the order of `StepKeys`."""
    return jax.random.split(jax.random.fold_in(key, steps), (worlds, len(StepKeys._fields)))


def _acts(
    learner: Algorithm,
    keys: Any,
    own: PyTree,
    shared: PyTree,
    observation: Array,
    step: Int[Array, ""],
) -> Float[Array, "worlds act"]:
    """An action in each world."""
    return jax.vmap(
        lambda key, own, observation: choose(
            learner, key, eqx.combine(own, shared), observation, step
        )
    )(keys, own, observation)
