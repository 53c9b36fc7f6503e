"""Many runs of a tile-coded learner on a task; and one learner fed with given transitions."""

import dataclasses
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np

from detpg.features import TileCoding
from detpg.kernels.learners import LEARNERS, Learner
from detpg.kernels.loop import Plan, Records, World, compiled, replayed
from detpg.kernels.random import streams
from detpg.kernels.tasks import TASKS, environment
from detpg.kernels.tiles import active_of, tables
from detpg.machine import cores, memory
from detpg.types import Bounds, EnvironmentSpec


@dataclasses.dataclass(frozen=True)
class Curves:
    """What `run` measured of the mean policy; every array has shape (points, runs, evaluations).

    Attributes:
        returns: Undiscounted return of an episode, mean over the episodes; NaN if not finite.
        steps: Its length.
        saturated: Share of its steps at which the mean action lies beyond the legal range.
        solved: Whether the return is above the task's threshold.
        finite: Whether all learnt numbers are.
    """

    returns: np.ndarray
    steps: np.ndarray
    saturated: np.ndarray
    solved: np.ndarray
    finite: np.ndarray


def run(
    task: str,
    learner: str,
    hyper: Mapping[str, Any],
    *,
    runs: Sequence[int],
    horizon: int,
    evaluate_at: Sequence[int],
    seed: int = 0,
    points: Sequence[int] | None = None,
    options: Mapping[str, Any] | None = None,
    task_options: Mapping[str, Any] | None = None,
    features: TileCoding | None = None,
    scaled: bool = True,
    episodes: int = 1,
    threads: int = 1,
    dtype: type[np.floating] = np.float64,
) -> Curves:
    """Trains every point of a grid in several runs, and plays the mean policy along the way.

    What a run learns depends on `seed`, the number of its point and its own number alone: not on
    what else is run in the same call, on evaluations, or on the number of threads.

    Args:
        task: One of `TASKS`.
        learner: One of `LEARNERS`.
        hyper: Values of hyper-parameters by name, one or one for each point; step sizes as they are
            applied (see `detpg.features.divided`). Those not named take the algorithm's default,
            and gamma the task's.
        runs: Numbers of the runs, such as `range(30)`.
        horizon: Steps of learning.
        evaluate_at: Steps after which the mean policy is played, ascending.
        seed: Of the study.
        points: Numbers of the points; 0, 1, ... when not given.
        options: Structural options of the algorithm, such as `{"natural": True}`.
        task_options: Options of the environment, such as `{"noise": 0.025}`.
        features: The tile coder; ten tilings of ten tiles in each dimension when not given.
        scaled: Whether actions are in units of the legal range (see `ScaledActions`).
        episodes: How often the mean policy is played at each evaluation.
        threads: How many to use.
        dtype: Precision of what is learnt.

    Raises:
        ValueError: What does not fit, in one sentence.
    """
    world = environment(task, task_options or {})
    spec = world.spec
    features = TileCoding.for_environment(spec) if features is None else features
    table = _learner(learner).points(hyper, options or {}, spec.discount).astype(dtype)
    points = range(len(table)) if points is None else points
    at = np.asarray(evaluate_at, np.int64)
    _check(table, points, runs, horizon, at, episodes, threads, features, spec)

    shape = (len(points), len(runs), len(at))
    returns, steps, saturated = (np.full(shape, np.nan) for _ in range(3))
    records = Records(returns, steps, saturated, finite=np.zeros(shape, np.bool_))
    vectors = LEARNERS[learner].num_vectors(spec.action_size)
    _check_memory(vectors * features.size * np.dtype(dtype).itemsize, threads)
    numbers, tiles = _world(TASKS[task].constants(world), spec, scaled), tables(features)
    plan, words = Plan(horizon, at, episodes), streams(seed, points, runs)
    one_run = compiled(task, learner)

    def job(place: tuple[int, int]) -> None:
        weights = np.zeros((vectors, features.size), dtype)
        one_run(numbers, tiles, plan, table[place[0]], words[place], weights, records, place)

    pool = ThreadPoolExecutor(threads)
    try:
        for _ in pool.map(job, np.ndindex(len(points), len(runs))):
            pass
    finally:
        pool.shutdown(cancel_futures=True)
    return Curves(returns, steps, saturated, returns > TASKS[task].solved, records.finite)


class Experience(NamedTuple):
    """Transitions in a row, the observation as the features active in it.

    Attributes:
        active: Shape (time, active features).
        action: Shape (time, action components), as drawn, in the learner's units.
        reward: Shape (time,).
        next_active: Of the next observation; not read where it is terminal.
        terminated: Shape (time,).
        ended: Whether the next transition belongs to another episode.
    """

    active: np.ndarray
    action: np.ndarray
    reward: np.ndarray
    next_active: np.ndarray
    terminated: np.ndarray
    ended: np.ndarray


def active_features(features: TileCoding, observations: np.ndarray) -> np.ndarray:
    """Indices of the active features, one row for each observation.

    Raises:
        ValueError: Observations of another shape than (time, dimensions).
    """
    if np.ndim(observations) != 2 or np.shape(observations)[1] != len(features.grid):
        raise ValueError(
            f"The observations have shape {np.shape(observations)}: give one row of "
            f"{len(features.grid)} numbers for each."
        )
    found = np.zeros((len(observations), features.num_active), np.uint32)
    active_of(tables(features), np.ascontiguousarray(observations, np.float64), found)
    return found


def replay(
    learner: str,
    hyper: Mapping[str, float],
    experience: Experience,
    *,
    size: int,
    options: Mapping[str, Any] | None = None,
) -> dict[str, np.ndarray]:
    """What a learner has learnt from given transitions, in double precision.

    Args:
        learner: One of `LEARNERS`.
        hyper: As in `run`, one point; gamma must be named.
        experience: The transitions.
        size: Number of features.
        options: As in `run`.

    Returns:
        The learnt vectors and traces by name.

    Raises:
        ValueError: What does not fit, in one sentence.
    """
    kernel = _learner(learner)
    if "gamma" not in hyper:
        raise ValueError("gamma is missing: a replay has no task to take it from.")
    table = kernel.points(hyper, options or {}, hyper["gamma"])
    if len(table) != 1:
        raise ValueError(f"{len(table)} points cannot be replayed at once: give one.")
    active, action, reward, next_active, terminated, ended = map(np.asarray, experience)
    _check_experience(experience, size)
    (numbers,), action_size = table, action.shape[1]
    weights = np.zeros((kernel.num_vectors(action_size), size))
    active, next_active = active.astype(np.uint32), next_active.astype(np.uint32)
    action, reward = action.astype(np.float64), reward.astype(np.float64)
    replayed(learner)(weights, numbers, active, next_active, action, reward, terminated, ended)
    return kernel.named(weights, action_size)


def _check_experience(experience: Experience, size: int) -> None:
    """Compiled loops do not look where they write."""
    arrays = {name: np.asarray(values) for name, values in experience._asdict().items()}
    shapes = {name: values.shape for name, values in arrays.items()}
    steps = shapes["reward"][:1]
    rows = (*steps, *shapes["active"][1:2]), (*steps, *shapes["action"][1:2])
    wanted = {"active": rows[0], "next_active": rows[0], "action": rows[1]}
    for name, shape in shapes.items():
        needed = wanted.get(name, steps)
        if shape != needed or len(needed) != 1 + (name in wanted):
            raise ValueError(
                f"{name} has shape {shape}, which does not fit: give one row of indices or of "
                "action components, and one number of the rest, for each transition."
            )
    for name in ("active", "next_active"):
        beyond = arrays[name][(arrays[name] < 0) | (arrays[name] >= size)]
        if beyond.size:
            raise ValueError(f"{name} has the index {beyond[0]}: give 0 to {size - 1}, of size.")


def _check_memory(size: int, threads: int) -> None:
    """Refuses weights that the memory does not hold; each thread has those of its run."""
    free = memory()
    if free is not None and threads * size > free:
        raise ValueError(
            f"The weights of a run take {size:,} bytes, with {threads} threads at once, and "
            f"{free:,} are free: give fewer tiles or threads, or a tile coder with memory=65536, "
            "which hashes."
        )


def _learner(name: str) -> Learner:
    if name not in LEARNERS:
        raise ValueError(f"Learner {name!r} is not compiled: choose one of {', '.join(LEARNERS)}.")
    return LEARNERS[name]


def _world(constants: np.ndarray, spec: EnvironmentSpec, scaled: bool) -> World:
    low, high = map(np.array, Bounds(spec.action_low, spec.action_high))
    centre, half = (low + high) / 2, (high - low) / 2
    if not scaled:
        centre, half = np.zeros_like(low), np.ones_like(low)
    return World(constants, centre, half, low, high, spec.time_limit)


def _check(
    table: np.ndarray,
    points: Sequence[int],
    runs: Sequence[int],
    horizon: int,
    at: np.ndarray,
    episodes: int,
    threads: int,
    features: TileCoding,
    spec: EnvironmentSpec,
) -> None:
    if not 1 <= threads <= cores():
        raise ValueError(f"threads = {threads} is not usable: give 1 to {cores()}, the cores here.")
    if len(points) != len(table):
        raise ValueError(f"{len(points)} numbers for {len(table)} points: give one for each.")
    if len(runs) < 1 or min(*points, *runs) < 0:
        raise ValueError("Points and runs are numbered from 0, and at least one run is needed.")
    if horizon < 0 or episodes < 1:
        raise ValueError(
            f"horizon = {horizon} and episodes = {episodes} are not usable: "
            "give at least 0 steps and 1 episode."
        )
    if at.size < 1 or at[0] < 0 or at[-1] > horizon or np.any(np.diff(at) <= 0):
        raise ValueError(
            f"evaluate_at must ascend from 0 or later to at most the horizon, {horizon}."
        )
    if len(features.grid) != spec.observation_size:
        raise ValueError(
            f"The tile coder has {len(features.grid)} dimensions, but observations of "
            f"{spec.name!r} have {spec.observation_size}: give one that fits."
        )
