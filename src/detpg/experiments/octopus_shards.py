"""Shards of a study on the octopus arm: learning and playing in turns, kept after every turn."""

import contextlib
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray, PyTree

from detpg import trees
from detpg.algorithms import ALGORITHMS
from detpg.critics import MLPStateValue
from detpg.environments import OctopusArm
from detpg.experiments.study import Arm, Condition, Results
from detpg.experiments.sweep import COMPILER_OPTIONS, STREAMS, Shard
from detpg.policies import MLPPolicy
from detpg.runs import numbered, read_arrays, write_arrays
from detpg.training import TrainState, begin, train
from detpg.types import Algorithm, Policy

FURTHER = ("return",)
POLICY = "policy.npz"
HIDDEN, VALUE_UNITS = 8, 40  # Section 5.3
# Numbers in the widest vector of a processor. Fewer runs go one by one: ten take longer than 16.
LANES = 16


# Options of an arm that are the environment's or the policy's, not the algorithm's.
_OF_ENVIRONMENT = ("observation_scale", "hit_reward", "time_limit")
_OF_POLICY = "output_width"


def environment_of(arm: Arm) -> OctopusArm:
    """The octopus arm as a learner of the study meets it."""
    return OctopusArm(**{name: value for name, value in arm.options if name in _OF_ENVIRONMENT})


def policy_of(arm: Arm, environment: OctopusArm) -> MLPPolicy:
    """mu_theta of Section 5.3: sigmoid units, sigmoid outputs."""
    sizes, width = environment.spec, dict(arm.options)[_OF_POLICY]
    return MLPPolicy(
        sizes.observation_size,
        sizes.action_size,
        (HIDDEN,),
        activation="sigmoid",
        output="sigmoid",
        output_width=width,
    )


def learner_of(arm: Arm, environment: OctopusArm, point: dict[str, Any]) -> Algorithm:
    """COPDAC-Q with the networks of Section 5.3 at one point of its grid."""
    spec = environment.spec
    kept = {n: v for n, v in arm.options if n not in (*_OF_ENVIRONMENT, _OF_POLICY)}
    policy = policy_of(arm, environment)
    value = MLPStateValue(spec.observation_size, VALUE_UNITS)
    parts = {"policy": policy, "state_value": value}
    return ALGORITHMS[arm.algorithm].create(spec, **parts, **kept, **point)


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
    num_points, num_seeds, times = len(shard.points[0][1]), len(shard.seeds), shard.condition.times
    points = _side_by_side(shard)
    root = jax.random.fold_in(jax.random.key(shard.study_seed), STREAMS[shard.phase])
    seeds = jnp.tile(jnp.asarray(shard.seeds), num_points)
    keys = jax.vmap(lambda seed: jax.random.split(jax.random.fold_in(root, seed)))(seeds)
    begun, interval = _programs(shard.arm, shard.condition)
    states = begun(points, keys[:, 0])
    states, seen = _loaded(shard.checkpoint, states)
    for _ in times[len(seen) :]:
        states, measured = interval(points, keys[:, 1], states)
        seen.append(np.asarray(measured))
        _keep(shard.checkpoint, states, seen)
    return np.stack(seen, axis=1).reshape(num_points, num_seeds, len(times), -1)


def _side_by_side(shard: Shard) -> dict[str, Array]:
    """The point of each run: points and seeds are one axis, seeds the faster.

    The arms' physics are quickest on one long axis.
    """
    values = {name: jnp.asarray(of_points, dtype=float) for name, of_points in shard.points}
    return {name: jnp.repeat(column, len(shard.seeds)) for name, column in values.items()}


@functools.cache
def _programs(
    arm: Arm, condition: Condition
) -> tuple[Callable[..., TrainState], Callable[..., tuple[TrainState, Array]]]:
    """The start of a batch of runs, and an interval of learning with an episode at its end."""
    environment, steps = environment_of(arm), condition.times[0]

    def start(point: dict[str, Array], key: PRNGKeyArray) -> TrainState:
        return begin(learner_of(arm, environment, point), environment, key)

    def learn(
        point: dict[str, Array], key: PRNGKeyArray, state: TrainState
    ) -> tuple[TrainState, Array]:
        learner = learner_of(arm, environment, point)
        train_key, play_key = jax.random.split(key)
        state, _ = train(learner, environment, train_key, steps, start=state)
        return state, episode(learner, environment, play_key, state.learner)

    return _batch(start), _batch(learn)


def _batch(one: Callable[..., Any]) -> Callable[..., Any]:
    """A function of one run for many, compiled: few are repeated until they fill a vector."""

    def many(*of_runs: Any) -> Any:
        size = len(jax.tree.leaves(of_runs)[0])
        runs = jnp.arange(max(size, LANES)) % size
        filled = jax.vmap(one)(*jax.tree.map(lambda leaf: leaf[runs], of_runs))
        return jax.tree.map(lambda leaf: leaf[:size], filled)

    return jax.jit(many, compiler_options=COMPILER_OPTIONS)


def _keep(path: str | None, states: TrainState, seen: list[np.ndarray]) -> None:
    if path is None:
        return
    # Without a checkpoint a run can still be finished; what is wrong with the disk is said when the
    # finished shard is saved.
    with contextlib.suppress(OSError):
        write_arrays(Path(path), {"seen": np.stack(seen), **numbered(states)})


def _loaded(path: str | None, states: TrainState) -> tuple[TrainState, list[np.ndarray]]:
    """What the checkpoint holds, or the start where there is none or it is damaged."""
    kept = None if path is None else read_arrays(Path(path))
    if kept is None:
        return states, []
    return _restored(jax.tree.structure(states), kept), list(kept["seen"])


def _restored(structure: Any, kept: dict[str, np.ndarray]) -> Any:
    """A tree from its numbered leaves."""
    leaves = [jnp.asarray(kept[f"leaf{i}"]) for i in range(structure.num_leaves)]
    return jax.tree.unflatten(structure, leaves)


def keep_policy(results: Results, shards: list[Shard], directory: Path) -> None:
    """Writes `policy.npz`: theta of the first learner's run that ends with the median steps.

    Args:
        results: Of the finished study.
        shards: Its shards of fresh runs, whose checkpoints are still there.
        directory: Of the study.
    """
    condition, name = next(iter(results.selections))
    row = results.selections[condition, name].row(results.study.rules[0])
    steps = results.costs[condition, name, "fresh"][row, :, -1]
    seed = int(np.argsort(steps, kind="stable")[len(steps) // 2])
    shard = next(
        s for s in shards if (s.condition, s.arm.name) == (condition, name) and seed in s.seeds
    )
    if shard.steps_kept() < shard.steps:
        run_octopus_shard(shard)  # its checkpoint was lost: the same runs again
    begun, _ = _programs(shard.arm, shard.condition)
    points, num_seeds = _side_by_side(shard), len(shard.seeds)
    keys = jax.random.split(jax.random.key(0), len(shard.points[0][1]) * num_seeds)
    states, _ = _loaded(shard.checkpoint, begun(points, keys))
    run = row * num_seeds + shard.seeds.index(seed)
    theta = jax.tree.map(lambda x: x[run], states.learner.theta)
    write_arrays(directory / POLICY, {"seed": seed, **numbered(theta)})


def kept_policy(arm: Arm, environment: OctopusArm, path: Path) -> tuple[Policy, PyTree]:
    """The policy and theta of a file that `keep_policy` wrote.

    Raises:
        FileNotFoundError: It is not there, damaged, or of another policy.
    """
    policy = policy_of(arm, environment)
    leaves, structure = jax.tree.flatten(jax.eval_shape(policy.init, jax.random.key(0)))
    names = [f"leaf{i}" for i in range(len(leaves))]
    kept = read_arrays(path, names)
    if kept is None or [kept[name].shape for name in names] != [leaf.shape for leaf in leaves]:
        raise FileNotFoundError(
            f"{path} is missing, damaged, or of another policy: name the {POLICY} of Figure 3."
        )
    return policy, _restored(structure, kept)
