"""Shards of a study on the octopus arm: learning and playing in turns, kept after every turn."""

import functools
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray, PyTree

from detpg import trees
from detpg.algorithms import ALGORITHMS
from detpg.critics import MLPStateValue
from detpg.environments import OctopusArm
from detpg.experiments.study import Arm, Options
from detpg.experiments.sweep import COMPILER_OPTIONS, STREAMS, Shard
from detpg.policies import MLPPolicy
from detpg.runs import write_atomically
from detpg.training import TrainState, begin, train
from detpg.types import Algorithm

FURTHER = ("return",)
HIDDEN, VALUE_UNITS = 8, 40  # Section 5.3


def learner_of(arm: Arm, environment: OctopusArm, point: dict[str, Any]) -> Algorithm:
    """COPDAC-Q with the networks of Section 5.3 at one point of its grid."""
    spec, options = environment.spec, dict(arm.options)
    width = options.pop("output_width")
    sizes = spec.observation_size, spec.action_size
    policy = MLPPolicy(*sizes, (HIDDEN,), "sigmoid", "sigmoid", output_width=width)
    value = MLPStateValue(spec.observation_size, VALUE_UNITS)
    parts = {"policy": policy, "state_value": value}
    return ALGORITHMS[arm.algorithm].create(spec, **parts, **options, **point)


def episode(
    algorithm: Algorithm, environment: OctopusArm, key: PRNGKeyArray, learner: PyTree
) -> Float[Array, "2"]:
    """Steps to the target (the time limit where it is missed) and return, of the mean policy."""

    def body(carry: Any, _: None) -> tuple[Any, None]:
        state, ended, steps, total = carry
        action = algorithm.greedy(learner, environment.observe(state))
        next_state = environment.transition(key, state, action)
        reward = environment.reward(state, action, next_state)
        steps = steps + jnp.where(ended, 0.0, 1.0)
        total = total + jnp.where(ended, jnp.zeros_like(reward), reward)
        ended_now = ended | environment.terminated(next_state)
        return (trees.where(ended, state, next_state), ended_now, steps, total), None

    zero = jnp.zeros(())
    start = environment.initial(key), jnp.asarray(False), zero, zero
    (_, _, steps, total), _ = jax.lax.scan(body, start, None, length=environment.time_limit)
    return jnp.stack([steps, total])


def run_octopus_shard(shard: Shard) -> np.ndarray:
    """Steps to the target and return of every run of a shard, shape (points, seeds, time, 2).

    After every recording the whole state of all runs is written to the shard's checkpoint, so that
    a run that is killed goes on from there, to the same numbers.
    """
    points = {name: jnp.asarray(values, dtype=float) for name, values in shard.points}
    root = jax.random.fold_in(jax.random.key(shard.study_seed), STREAMS[shard.phase])
    seeds = jnp.asarray(shard.seeds)
    keys = jax.vmap(lambda seed: jax.random.split(jax.random.fold_in(root, seed)))(seeds)
    times = shard.condition.times
    begun, interval = _programs(shard.arm, shard.condition.options, times[0])
    states = begun(points, keys[:, 0])
    states, seen = _loaded(shard.checkpoint, states)
    for _ in times[len(seen) :]:
        states, measured = interval(points, keys[:, 1], states)
        seen.append(np.asarray(measured))
        _keep(shard.checkpoint, states, seen)
    return np.stack(seen, axis=2)


@functools.cache
def _programs(
    arm: Arm, options: Options, interval: int
) -> tuple[Callable[..., TrainState], Callable[..., tuple[TrainState, Array]]]:
    """The start of points x seeds, and one interval of learning with a played episode at its end."""
    environment = OctopusArm(**dict(options))

    def start(point: dict[str, Array], key: PRNGKeyArray) -> TrainState:
        return begin(learner_of(arm, environment, point), environment, key)

    def learn(
        point: dict[str, Array], key: PRNGKeyArray, state: TrainState
    ) -> tuple[TrainState, Array]:
        learner = learner_of(arm, environment, point)
        train_key, play_key = jax.random.split(key)
        state, _ = train(learner, environment, train_key, interval, start=state)
        return state, episode(learner, environment, play_key, state.learner)

    def grid(one: Callable[..., Any], *axes: Any) -> Callable[..., Any]:
        inner = jax.vmap(one, in_axes=(None, 0, *axes))
        return jax.jit(
            jax.vmap(inner, in_axes=(0, None, *axes)), compiler_options=COMPILER_OPTIONS
        )

    return grid(start), grid(learn, 0)


def _keep(path: str | None, states: TrainState, seen: list[np.ndarray]) -> None:
    if path is None:
        return
    content = io.BytesIO()
    leaves = {f"leaf{i}": np.asarray(x) for i, x in enumerate(jax.tree.leaves(states))}
    np.savez(content, seen=np.stack(seen), **leaves)
    write_atomically(Path(path), lambda file: file.write(content.getbuffer()))


def _loaded(path: str | None, states: TrainState) -> tuple[TrainState, list[np.ndarray]]:
    """What the checkpoint holds, or the start where there is none."""
    if path is None or not Path(path).exists():
        return states, []
    try:
        with np.load(path, allow_pickle=False) as kept:
            leaves, structure = jax.tree.flatten(states)
            known = [jnp.asarray(kept[f"leaf{i}"]) for i in range(len(leaves))]
            return jax.tree.unflatten(structure, known), list(kept["seen"])
    except (ValueError, EOFError, KeyError, BadZipFile):  # damaged: those runs start over
        return states, []
