"""Batch updates per second of the bandit sweep, against the plain NumPy loop."""

import os
import time
from collections.abc import Iterator

import numpy as np

from benchmarks.numpy_bandit import numpy_copdac, numpy_stochastic_ac
from benchmarks.rows import Row
from detpg.executors import Processes
from detpg.experiments.figure1 import ACTORS, COPDAC, FIGURE1, adapted
from detpg.experiments.study import Condition
from detpg.experiments.sweep import Shard, plan, run_shard

SEEDS = 5
BASELINE_SECONDS = 2.0


def rows(dimensions: tuple[int, ...]) -> Iterator[Row]:
    """One row for each m: the whole sweep of both learners, all cores, compile time apart."""
    for m in dimensions:
        shards = _shards(m)
        runs = sum(len(shard.points[0][1]) * len(shard.seeds) for shard in shards)
        updates = FIGURE1.steps // (2 * m)
        first, seconds = _time(shards)
        value, baseline = runs * updates / seconds, _baseline(m)
        yield Row(
            id=f"figure1.sweep.m{m}",
            value=value,
            unit="batch updates/s",
            baseline=baseline,
            ratio=value / baseline,
            note=f"{runs} runs in {seconds:.1f} s; start and compilation {first - seconds:.1f} s",
        )


def _shards(m: int) -> list[Shard]:
    condition = Condition("bandit", (("m", m), ("spectrum", "mixed")))
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
            steps=FIGURE1.steps,
            record_every=FIGURE1.record_every,
        )
    ]


def _time(shards: list[Shard]) -> tuple[float, float]:
    """Seconds of the sweep from nothing, and again with every program compiled."""
    programs = [shard.program for shard in shards]
    seconds = []
    with Processes(run_shard, os.cpu_count() or 1) as executor:
        for _ in range(2):
            began = time.perf_counter()
            list(executor.run(shards, programs))
            seconds.append(time.perf_counter() - began)
    return seconds[0], seconds[1]


def _baseline(m: int) -> float:
    """Batch updates per second of the NumPy loop, both learners in equal parts."""
    generator = np.random.default_rng(0)
    rotation = np.linalg.qr(generator.standard_normal((m, m)))[0]
    C = (rotation * np.where(np.arange(m) < m // 2, 0.1, 1.0)) @ rotation.T
    block, updates, began = 50, 0, time.perf_counter()
    while time.perf_counter() - began < BASELINE_SECONDS:
        numpy_copdac(generator, C, 0.1, 0.1, block)
        numpy_stochastic_ac(generator, C, 0.01, 1e-4, 1.0, block)
        updates += 2 * block
    return updates / (time.perf_counter() - began)
