"""Steps per second of the compiled learners on the mountain car.

Per thread, against a plain loop in C (mountain_car.c) and against the same algorithm in JAX, by CPU
time; two threads against one by the clock. The best of several repeats counts.
"""

import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import jax

from benchmarks.rows import Row
from detpg.algorithms import COPDACQ
from detpg.critics import LinearStateValue
from detpg.environments import MountainCar, ScaledActions
from detpg.features import TileCoding, divided
from detpg.kernels import run
from detpg.machine import cores
from detpg.policies import FeaturePolicy
from detpg.training import train

SOURCE = Path(__file__).parent / "mountain_car.c"
REPEATS = 7
STEPS, RUNS = 1_000_000, 4
LONG_RUNS = 16  # two threads start and end at moments of their own: long enough to hide it
JAX_STEPS, JAX_RUNS = 2_000, 16
FEATURES = TileCoding.for_environment(MountainCar().spec)
HYPER = {  # as in mountain_car.c
    "copdac-q": {"alpha_theta": 0.005, "alpha_w": 0.1, "alpha_v": 0.1, "sigma": 0.5},
    "stochastic-ac": {"alpha_u": 0.005, "alpha_y": 5e-6, "alpha_v": 0.1, "sigma0": 0.5},
}


def rows(wanted: tuple[str, ...]) -> Iterator[Row]:
    """One row for each comparison; none where what it needs is not here."""
    for name in wanted:
        baseline, value, note = MEASURES[name]()
        if baseline is None:
            print(f"bench: {name} left out: {note}.", file=sys.stderr)
            continue
        yield Row(name, value, "steps/s", baseline, value / baseline, note)


Measured = tuple[float | None, float, str]


def against_c(learner: str) -> Measured:
    """Of one thread, beside one thread of C."""
    compiler = shutil.which("cc")
    if compiler is None:
        return None, 0.0, "there is no C compiler cc"
    with tempfile.TemporaryDirectory() as folder:
        program = f"{folder}/mountain_car"
        subprocess.run(
            [compiler, "-O3", "-march=native", "-o", program, str(SOURCE), "-lm"], check=True
        )
        # In turns, so that a busy moment of the machine meets both.
        pairs = [(in_c(program, learner), here(learner, time.process_time)) for _ in range(REPEATS)]
    baseline, value = (max(found) for found in zip(*pairs, strict=True))
    return baseline, value, "baseline: one run after another in C, -O3; target at least 0.8"


def in_c(program: str, learner: str) -> float:
    """Steps per second of CPU time in C."""
    found = subprocess.run(
        [program, learner, str(STEPS), str(RUNS)], capture_output=True, text=True, check=True
    )
    return 1e9 / float(found.stdout.split()[0])


def here(learner: str, clock: Callable[[], float], threads: int = 1, runs: int = RUNS) -> float:
    """Steps per second of the compiled learner, the program compiled before."""
    hyper = divided(FEATURES, HYPER[learner])

    def play(horizon: int, runs: int) -> None:
        run(
            "mountain-car",
            learner,
            hyper,
            runs=range(runs),
            horizon=horizon,
            evaluate_at=[horizon],
            threads=threads,
        )

    play(0, 1)
    began = clock()
    play(STEPS, runs)
    return STEPS * runs / (clock() - began)


def against_jax() -> Measured:
    """Of one thread, beside `detpg.train` of the algorithm over a batch of runs."""
    environment: Any = ScaledActions(MountainCar())
    learner = COPDACQ.create(
        environment.spec,
        policy=FeaturePolicy(FEATURES, 1),
        state_value=LinearStateValue(FEATURES),
        **divided(FEATURES, HYPER["copdac-q"]),
    )
    many = jax.jit(
        jax.vmap(lambda key: train(learner, environment, key, JAX_STEPS)[0].learner.theta)
    )
    keys = jax.random.split(jax.random.key(0), JAX_RUNS)
    jax.block_until_ready(many(keys))
    best = 0.0
    for _ in range(REPEATS):
        began = time.process_time()
        jax.block_until_ready(many(keys))
        best = max(best, JAX_STEPS * JAX_RUNS / (time.process_time() - began))
    value = max(here("copdac-q", time.process_time) for _ in range(REPEATS))
    return best, value, f"baseline: {JAX_RUNS} runs side by side in JAX; target at least 8"


def two_threads() -> Measured:
    """Of two threads, beside one."""
    if cores() < 2:
        return None, 0.0, "there is one core"
    pairs = [
        tuple(here("copdac-q", time.perf_counter, threads, LONG_RUNS) for threads in (1, 2))
        for _ in range(REPEATS)
    ]
    baseline, value = (max(found) for found in zip(*pairs, strict=True))
    return baseline, value, "baseline: one thread, by the clock; target at least 1.8"


MEASURES: dict[str, Callable[[], Measured]] = {
    "kernels.copdac_q.vs_c": lambda: against_c("copdac-q"),
    "kernels.copdac_q.vs_jax": against_jax,
    "kernels.stochastic_ac.vs_c": lambda: against_c("stochastic-ac"),
    "kernels.threads2_vs_1": two_threads,
}
IDS = tuple(MEASURES)
