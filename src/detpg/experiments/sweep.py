"""Points x seeds under `vmap`, in shards of one shape: the one way a study is run."""

import dataclasses
import functools
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from detpg.algorithms import ALGORITHMS
from detpg.environments import ENVIRONMENTS
from detpg.evaluation.rollout import greedy_return
from detpg.experiments.study import Arm, Condition, Phase
from detpg.runs import read_arrays
from detpg.training import train

# Level 2 compiles in two thirds of the time of the default level 3, and runs no slower.
COMPILER_OPTIONS = {"xla_backend_optimization_level": 2}
STREAMS: dict[Phase, int] = {"sweep": 0, "fresh": 1, "interval": 2}


@dataclasses.dataclass(frozen=True)
class Shard:
    """A block of points and seeds of one learner on one problem: the unit of work and of resume.

    Attributes:
        condition: The problem.
        arm: The learner.
        phase: Which stream of seeds.
        points: Hyper-parameter -> values, at most `shape[0]`.
        seeds: Numbers of the seeds, at most `shape[1]`.
        shape: Points and seeds side by side; what is missing is padded.
        study_seed: The study's seed.
        index: Position among the shards of the same condition, arm and phase.
        folder: Where a long shard may keep what it has done so far; None: nowhere.
    """

    condition: Condition
    arm: Arm
    phase: Phase
    points: tuple[tuple[str, tuple[float, ...]], ...]
    seeds: tuple[int, ...]
    shape: tuple[int, int]
    study_seed: int
    index: int
    folder: str | None = None

    @property
    def name(self) -> str:
        """File name of its result."""
        arm = self.arm.name.replace(" ", "-").replace(",", "")
        return f"{self.condition.label}-{arm}-{self.phase}-{self.index:04d}"

    @property
    def checkpoint(self) -> str | None:
        """File for what the shard has done so far."""
        return None if self.folder is None else f"{self.folder}/{self.name}.npz"

    @property
    def steps(self) -> int:
        """Environment steps of all its runs."""
        return self.condition.steps * len(self.points[0][1]) * len(self.seeds)

    def steps_kept(self) -> int:
        """Those that its checkpoint has behind it."""
        kept = read_arrays(Path(self.checkpoint or ""), only=("seen",))
        return round(self.steps * len(kept["seen"]) / len(self.condition.times)) if kept else 0

    @property
    def program(self) -> tuple[Any, ...]:
        """Shards with the same program need no compilation after the first."""
        sizes = [(k, v) for k, v in self.condition.options if isinstance(v, int)]
        return (self.condition.environment, *sizes, self.arm.algorithm, self.arm.options)


def plan(
    condition: Condition,
    arm: Arm,
    phase: Phase,
    points: dict[str, np.ndarray],
    num_seeds: int,
    *,
    shape: tuple[int, int],
    study_seed: int,
    folder: str | None = None,
) -> list[Shard]:
    """Cuts points x seeds into shards, points first.

    Args:
        condition: The problem.
        arm: The learner.
        phase: Which stream of seeds.
        points: Hyper-parameter -> values, all of one length.
        num_seeds: Seeds 0 ... num_seeds - 1 of the phase's stream.
        shape: Points and seeds side by side in one shard.
        study_seed: The study's seed.
        folder: See `Shard`.
    """
    num_points, (wide, deep) = len(next(iter(points.values()))), shape
    blocks = [
        (slice(p, p + wide), range(s, min(s + deep, num_seeds)))
        for p in range(0, num_points, wide)
        for s in range(0, num_seeds, deep)
    ]
    return [
        Shard(
            condition,
            arm,
            phase,
            tuple((name, tuple(values[part].tolist())) for name, values in points.items()),
            tuple(seeds),
            shape,
            study_seed,
            index,
            folder,
        )
        for index, (part, seeds) in enumerate(blocks)
    ]


def join(shards: list[Shard], results: list[np.ndarray]) -> np.ndarray:
    """Results of all shards of a plan as one array (points, seeds, time)."""
    rows: list[list[np.ndarray]] = []
    for shard, result in zip(shards, results, strict=True):
        if shard.seeds[0] == 0:
            rows.append([])
        rows[-1].append(result)
    return np.concatenate([np.concatenate(row, axis=1) for row in rows], axis=0)


def run_shard(shard: Shard) -> np.ndarray:
    """Metric of every run of a shard, shape (points, seeds, time), float32.

    The shard is padded to one shape, so that a program is compiled once for a learner and a size.
    """
    arm = shard.arm
    program = _program(arm.algorithm, arm.options, shard.condition.times)
    num_points, num_seeds = len(shard.points[0][1]), len(shard.seeds)
    points = {
        name: jnp.asarray(np.resize(values, shard.shape[0]), dtype=float)
        for name, values in shard.points
    }
    root = jax.random.fold_in(jax.random.key(shard.study_seed), STREAMS[shard.phase])
    seeds = jnp.asarray(np.resize(shard.seeds, shard.shape[1]))
    keys = jax.vmap(lambda seed: jax.random.split(jax.random.fold_in(root, seed)))(seeds)
    environments = _build(shard.condition)(keys[:, 0])
    costs = np.asarray(program(points, environments, keys[:, 1]))
    return costs[:num_points, :num_seeds]


@functools.cache
def _build(condition: Condition):
    """One problem for each key, compiled: what is random about it is drawn per seed."""
    environment: Any = ENVIRONMENTS[condition.environment]
    draw = jax.vmap(lambda key: environment(**dict(condition.options), key=key))
    return jax.jit(draw, compiler_options=COMPILER_OPTIONS)


@functools.cache
def _program(
    algorithm: str,
    options: tuple[tuple[str, Any], ...],
    times: tuple[int, ...],
):
    """The compiled run of points x seeds.

    The noise of a run depends on its seed alone, so points are compared on the same noise, and it
    is drawn once for all of them.
    """

    def one(
        point: dict[str, Float[Array, ""]], environment: Any, key: PRNGKeyArray
    ) -> Float[Array, "time"]:
        learner = ALGORITHMS[algorithm].create(environment.spec, **dict(options), **point)
        train_key, evaluation_key = jax.random.split(key)

        def cost_of_mean(state: Any) -> Float[Array, ""]:
            return -greedy_return(learner, environment, evaluation_key, state)

        _, log = train(learner, environment, train_key, times[-1], probe=cost_of_mean)
        size = learner.experience.steps
        odd = [time for time in times if time % size]
        if odd:
            raise ValueError(
                f"A recording at step {odd[0]} is not possible: give multiples of {size}, the "
                "steps of one update."
            )
        return log.probe[np.array(times) // size - 1]

    over_seeds = jax.vmap(one, in_axes=(None, 0, 0))
    over_points = jax.vmap(over_seeds, in_axes=(0, None, None))
    return jax.jit(over_points, compiler_options=COMPILER_OPTIONS)
