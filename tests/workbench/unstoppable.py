"""Trains every algorithm of the registry, one after another, into folders; goes on where it stood.

Usage: python unstoppable.py FOLDER
"""

import os
import sys
from pathlib import Path

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")
os.environ.setdefault("JAX_DISABLE_MOST_OPTIMIZATIONS", "1")

TABLES = ("metrics.parquet", "evaluations.parquet")
RUNS = (
    "bandit-copdac",
    "bandit-stochastic-ac",
    "copdac-gq",
    "copdac-q",
    "dac",
    "ddpg",
    "offpac",
    "opdac",
    "stochastic-ac",
    "td3",
)
RECALLED = {"batch": 8, "warm_up": 100, "memory": 500}  # a ring that is full before the end

STEPS = {"log_every": 40, "evaluate_every": 80, "checkpoint_every": 80, "evaluation_episodes": 1}


def train_all(folder: Path) -> None:
    """All of them; small step sizes, so that none diverges."""
    from detpg.algorithms import ALGORITHMS
    from detpg.workbench import Config, train_in

    assert tuple(ALGORITHMS) == RUNS
    for name in RUNS:
        bandit = name.startswith("bandit")
        correlated = {"correlation": 0.8} if name in ("copdac-gq", "copdac-q", "opdac") else {}
        traced = {"lambda_": 0.5, "alpha_v": 1e-3} if name in ("offpac", "stochastic-ac") else {}
        config = Config(
            name,
            "bandit" if bandit else "lqr",
            environment_options={"m": 2} if bandit else {},
            time_limit=None if bandit else 30,
            options=correlated | traced | (RECALLED if name in ("ddpg", "td3") else {}),
            normalise="both",
            steps=800,
            **STEPS,
        )
        train_in(folder / name, config)


if __name__ == "__main__":
    train_all(Path(sys.argv[1]))
