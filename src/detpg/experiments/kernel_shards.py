"""Shards of a study that compiled loops run: tile-coded linear learners on the control tasks."""

import functools

import numpy as np

from detpg.environments import ENVIRONMENTS
from detpg.experiments.sweep import STREAMS, Shard
from detpg.features import TileCoding
from detpg.features.tile_coding import divided
from detpg.kernels import run

# Seeds of different phases never meet: a phase has fewer than this many.
PHASE_RUNS = 1_000_000
FURTHER = ("episode_steps", "saturated")  # steps of the episode; share with actions out of range


@functools.cache
def tile_coder(task: str) -> TileCoding:
    """Ten tilings of 10 x 10 tiles and a bias, over the whole state (Section 5.2)."""
    return TileCoding.for_environment(ENVIRONMENTS[task]().spec)


def run_kernel_shard(shard: Shard) -> np.ndarray:
    """Negative return of the mean policy of each run of a shard, its steps and saturation, float32.

    All points of a study meet the same noise in the run of a given number: they are compared in
    pairs. Actions are in units of the legal range; step sizes are divided by the active features.

    Returns:
        Shape (points, seeds, time, 3); NaN from where a run is no longer finite. The last axis has
        the cost and what `FURTHER` names.
    """
    task, coder = shard.condition.environment, tile_coder(shard.condition.environment)
    hyper = {name: np.asarray(values) for name, values in shard.points}
    num_points = len(shard.points[0][1])
    first = PHASE_RUNS * STREAMS[shard.phase]
    curves = run(
        task,
        shard.arm.algorithm,
        divided(coder, hyper),
        runs=[first + seed for seed in shard.seeds],
        horizon=shard.condition.steps,
        evaluate_at=shard.condition.times,
        seed=shard.study_seed,
        points=[0] * num_points,
        options=dict(shard.arm.options),
        features=coder,
    )
    measured = -curves.returns, curves.steps, curves.saturated
    return np.stack(measured, axis=-1).astype(np.float32)
