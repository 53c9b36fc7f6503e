"""The one loop over time: act, step the world, update; resets and time limits live here.

In: an algorithm and an environment. Out: the learner's state and a log.
Next: `detpg.evaluation` plays its greedy policy, `detpg.experiments` runs many such loops.

Randomness: step t uses `fold_in(key, t)` and one named split, so that a run resumed from a saved
`TrainState` with the same key is equal to the bit. Evaluation has its own key and changes nothing.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, Key, PRNGKeyArray, PyTree

from detpg import trees
from detpg.experience import Experience
from detpg.learning import choose, learn, memory_of, recalling
from detpg.memory import Memory, remember
from detpg.types import Action, Algorithm, Environment, Transition


class Episode(eqx.Module):
    """Where the world stands: its state, the action chosen there, steps since the reset."""

    state: PyTree
    action: Action
    steps: Int[Array, ""]


class TrainState(eqx.Module):
    """Everything that the rest of a run depends on, besides its key.

    `memory` is None but for a learner that recalls. Of `train`'s steps together it holds as many as
    it was begun for.
    """

    learner: PyTree
    episode: Episode
    step: Int[Array, ""]
    memory: Memory | None = None


class Log(eqx.Module):
    """What was seen, with a leading axis over updates.

    Attributes:
        info: Diagnostics of each update.
        probe: What the caller's probe returned of the learner, before each update.
    """

    info: PyTree
    probe: PyTree


class StepKeys(NamedTuple):
    """The streams of one step."""

    environment: PRNGKeyArray
    behaviour: PRNGKeyArray
    update: PRNGKeyArray
    reset: PRNGKeyArray


def _start(
    algorithm: Algorithm,
    environment: Environment,
    key: PRNGKeyArray,
    learner: PyTree,
    step: Int[Array, ""],
) -> Episode:
    state_key, action_key = jax.random.split(key)
    state = environment.initial(state_key)
    action = choose(algorithm, action_key, learner, environment.observe(state), step)
    return Episode(state=state, action=action, steps=jnp.asarray(0, dtype=int))


def begin(
    algorithm: Algorithm, environment: Environment, key: PRNGKeyArray, steps: int | None = None
) -> TrainState:
    """The state before the first step.

    Args:
        algorithm: The learner.
        environment: The world.
        key: Used for the initial parameters and the first state, not for the loop.
        steps: Of the whole run: a memory holds no more (default: what the learner says).
    """
    learner_key, start_key = jax.random.split(key)
    learner = algorithm.init(learner_key)
    first = jnp.asarray(0, dtype=int)
    episode = _start(algorithm, environment, start_key, learner, first)
    capacity = algorithm.experience.capacity if steps is None else steps
    return TrainState(learner, episode, first, memory_of(algorithm, environment.spec, capacity))


def _step(
    algorithm: Algorithm, environment: Environment, keys: StepKeys, learner: PyTree, now: Episode
) -> tuple[Transition, PyTree]:
    """One step of the world: what is learnt from, and the next state, before any reset."""
    next_state = environment.transition(keys.environment, now.state, now.action)
    next_observation = environment.observe(next_state)
    transition = Transition(
        observation=environment.observe(now.state),
        action=now.action,
        reward=environment.reward(now.state, now.action, next_state),
        next_observation=next_observation,
        next_action=algorithm.act(keys.behaviour, learner, next_observation),
        terminated=environment.terminated(next_state),
        truncated=now.steps + 1 >= environment.spec.time_limit,
    )
    return transition, next_state


def _onwards(
    algorithm: Algorithm,
    environment: Environment,
    keys: StepKeys,
    learner: PyTree,
    now: Episode,
    transition: Transition,
    next_state: PyTree,
    step: Int[Array, ""],
) -> Episode:
    """Where the world stands after learning, reset where the episode ended.

    The action there is drawn now, by what was learnt: importance ratios and deviations from
    mu_theta are those of the parameters that it came from (docs/decisions/0015).
    """
    action = choose(algorithm, keys.behaviour, learner, transition.next_observation, step)
    ongoing = Episode(state=next_state, action=action, steps=now.steps + 1)
    fresh = _start(algorithm, environment, keys.reset, learner, step)
    return trees.where(transition.ended, fresh, ongoing)


def _batch(
    algorithm: Algorithm, environment: Environment, keys: Key[Array, "batch 4"], learner: PyTree
) -> Transition:
    """Episodes of one step: independent given the learner, so drawn side by side."""

    def one(key: Key[Array, "4"]) -> Transition:
        step = StepKeys(*key)
        state = environment.initial(step.reset)
        action = algorithm.act(step.behaviour, learner, environment.observe(state))
        now = Episode(state=state, action=action, steps=jnp.asarray(0, dtype=int))
        return _step(algorithm, environment, step, learner, now)[0]

    return jax.vmap(one)(keys)


def train(
    algorithm: Algorithm,
    environment: Environment,
    key: PRNGKeyArray,
    steps: int,
    *,
    start: TrainState | None = None,
    probe: Callable[[PyTree], PyTree] | None = None,
) -> tuple[TrainState, Log]:
    """Trains for a number of environment steps. Pure: jit and vmap it as you like.

    Args:
        algorithm: The learner.
        environment: The world.
        key: Key of the run; give the same one to every call that continues it.
        steps: Environment steps (static).
        start: Where to continue; from the beginning when not given.
        probe: Applied to the learner's state before each update, its results logged.

    Returns:
        The state after the last update, and the log.

    Raises:
        ValueError: A batch learner on episodes of more than one step, or a number of steps that
            is not a multiple of its batch.
    """
    loop_key, begin_key = jax.random.split(key)
    state = begin(algorithm, environment, begin_key, steps) if start is None else start
    taken = algorithm.experience
    _check_steps(taken, steps, environment.spec.time_limit)

    def body(state: TrainState, _: None) -> tuple[TrainState, Log]:
        key = jax.random.fold_in(loop_key, state.step)
        seen = None if probe is None else probe(state.learner)
        step = state.step + taken.steps
        if taken.kind == "fresh":
            keys = jax.random.split(key, (taken.batch, 4))
            transition = _batch(algorithm, environment, keys, state.learner)
            update_key = StepKeys(*keys[0]).update
            learner, info = algorithm.update(update_key, state.learner, transition)
            after = TrainState(learner, state.episode, step)
            return after, Log(info=info, probe=seen)
        keys, before = StepKeys(*jax.random.split(key, 4)), state.episode
        transition, next_state = _step(algorithm, environment, keys, state.learner, before)
        learner, memory, info = _learnt(algorithm, keys, state, transition)
        episode = _onwards(
            algorithm, environment, keys, learner, before, transition, next_state, step
        )
        return TrainState(learner, episode, step, memory), Log(info=info, probe=seen)

    return jax.lax.scan(body, state, None, length=steps // taken.steps)


def _learnt(
    algorithm: Algorithm, keys: StepKeys, state: TrainState, transition: Transition
) -> tuple[PyTree, Memory | None, PyTree]:
    """What a transition teaches: itself, or what is recalled once it is remembered."""
    if state.memory is None:
        learner, info = algorithm.update(keys.update, state.learner, transition)
        return learner, None, info
    follow_key, learn_key = jax.random.split(keys.update)
    learner = recalling(algorithm).follow(follow_key, state.learner, transition)
    memory = remember(state.memory, jax.tree.map(lambda leaf: leaf[None], transition))
    ready = state.step + 1 >= algorithm.experience.warm_up
    learner, info = learn(algorithm, learn_key, learner, memory, ready)
    return learner, memory, info


def _check_steps(taken: Experience, steps: int, time_limit: int) -> None:
    if taken.kind == "fresh" and time_limit != 1:
        raise ValueError(
            f"A learner with batches of {taken.batch} needs episodes of one step, but the "
            f"environment's time limit is {time_limit}: use an incremental learner."
        )
    if steps >= 2**31:
        raise ValueError(f"steps = {steps} is not usable: give less than 2^31.")
    if steps < 1 or steps % taken.steps:
        raise ValueError(
            f"steps = {steps} is not usable: give a positive multiple of {taken.steps}, "
            "the number of steps per update."
        )
