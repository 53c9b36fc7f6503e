"""Batch updates per second of the bandit sweep, against the plain NumPy loop."""

import time
from collections.abc import Iterator

import numpy as np

from benchmarks.numpy_bandit import (
    Fit,
    by_lstsq,
    by_normal_equations,
    numpy_copdac,
    numpy_stochastic_ac,
)
from benchmarks.rows import Row
from detpg.executors import Processes
from detpg.experiments.figure1 import ACTORS, COPDAC, FIGURE1, RECORDED, adapted
from detpg.experiments.study import Condition
from detpg.experiments.sweep import Shard, plan, run_shard
from detpg.machine import cores

SIZES = {f"figure1.sweep.m{m}": m for m in (10, 25, 50)}
IDS = tuple(SIZES)
SEEDS = 5
BASELINE_UPDATES = 400


def rows(wanted: tuple[str, ...]) -> Iterator[Row]:
    """One row for each m: the whole sweep of both learners, all cores, compile time apart."""
    for name in wanted:
        m = SIZES[name]
        shards = _shards(m)
        runs = [(shard.arm.name, len(shard.points[0][1]) * len(shard.seeds)) for shard in shards]
        num_runs = sum(number for _, number in runs)
        share = sum(number for arm, number in runs if arm == COPDAC) / num_runs
        first, seconds = _time(shards)
        value = num_runs * (RECORDED[-1] // (2 * m)) / seconds
        baseline, solved = (_baseline(m, fit, share) for fit in (by_lstsq, by_normal_equations))
        yield Row(
            id=name,
            value=value,
            unit="batch updates/s",
            baseline=baseline,
            ratio=value / baseline,
            note=f"{num_runs} runs in {seconds:.1f} s, start and compilation {first - seconds:.1f} "
            f"s; baseline float64 with lstsq; {value / solved:.1f} times one with normal equations",
        )


def _shards(m: int) -> list[Shard]:
    condition = Condition("bandit", (("m", m), ("spectrum", "mixed")), RECORDED)
    arms = [arm for arm in FIGURE1.arms if arm.name in (COPDAC, adapted(ACTORS[0]))]
    return [
        shard
        for arm in arms
        for shard in plan(
            condition,
            arm,
            "sweep",
            arm.points(),
            SEEDS,
            shape=FIGURE1.presets["paper"].shard,
            study_seed=0,
        )
    ]


def _time(shards: list[Shard]) -> tuple[float, float]:
    """Seconds of the sweep from nothing, and again with every program compiled."""
    programs = [shard.program for shard in shards]
    seconds = []
    with Processes(run_shard, cores()) as executor:
        for _ in range(2):
            began = time.perf_counter()
            list(executor.run(shards, programs))
            seconds.append(time.perf_counter() - began)
    return seconds[0], seconds[1]


def _baseline(m: int, fit: Fit, share: float) -> float:
    """Batch updates per second of the NumPy loop, the learners mixed as in the sweep.

    Args:
        m: Action dimensions.
        fit: How the regression is solved.
        share: Share of COPDAC-B's runs in the sweep.
    """
    generator = np.random.default_rng(0)
    rotation = np.linalg.qr(generator.standard_normal((m, m)))[0]
    C = (rotation * np.where(np.arange(m) < m // 2, 0.1, 1.0)) @ rotation.T
    seconds = []
    for learner in (numpy_copdac, numpy_stochastic_ac):
        learner(generator, fit, C, 20)
        began = time.perf_counter()
        learner(generator, fit, C, BASELINE_UPDATES)
        seconds.append((time.perf_counter() - began) / BASELINE_UPDATES)
    return 1 / (share * seconds[0] + (1 - share) * seconds[1])
