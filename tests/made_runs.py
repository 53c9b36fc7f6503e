"""Run directories as `detpg train` leaves them, with made-up numbers, and a run to open."""

import json
from pathlib import Path
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import polars as pl
import pyarrow as pa

from detpg.environments import ENVIRONMENTS

CONFIG = {"detpg": "0.1.0", "algorithm": "copdac-q", "environment": "Pendulum-v1", "seed": 0}
CONFIG |= {"policy": "auto"}
METRICS = ("rollout/ep_rew_mean", "train/td_error")


def write_run(path: Path, num_seeds: int = 3, **config: object) -> Path:
    """Evaluations at steps 0, 1000 and 2000, two episodes each; metrics at 500 and 1000.

    Episode e of seed s at step t returns t + 10 s + e.
    """
    path.mkdir(parents=True)
    (path / "config.json").write_text(json.dumps({**CONFIG, "seeds": num_seeds, **config}))
    rows = [
        (seed, step, episode, float(step + 10 * seed + episode), 200 + episode)
        for step in (0, 1000, 2000)
        for seed in range(num_seeds)
        for episode in range(2)
    ]
    columns = {"seed": pl.Int32, "step": pl.Int64, "episode": pl.Int32}
    columns |= {"return": pl.Float64, "length": pl.Int32}
    pl.DataFrame(rows, columns, orient="row").write_parquet(path / "evaluations.parquet")
    rows = [
        (seed, step, -1.0 - seed if step == 500 else None, step / 1000)
        for step in (500, 1000)
        for seed in range(num_seeds)
    ]
    columns = {"seed": pl.Int32, "step": pl.Int64, **dict.fromkeys(METRICS, pl.Float64)}
    pl.DataFrame(rows, columns, orient="row").write_parquet(path / "metrics.parquet")
    for policy in ("best", "last"):
        (path / f"{policy}.npz").write_bytes(b"")
    return path


class FakeRun:
    """Plays returns given in advance; notes what it was asked for."""

    def __init__(self, path: Path, returns: list[list[float]] | None = None):
        """Returns for each seed, an entry for each episode."""
        found = json.loads((path / "config.json").read_text())
        self.config = SimpleNamespace(**found)
        name = found["environment"]
        self.world = ENVIRONMENTS[name]() if name in ENVIRONMENTS else None
        self.returns, self.asked = returns, {}

    def play(self, which="best", episodes=10, seed=0):
        self.asked = {"which": which, "episodes": episodes, "seed": seed}
        assert self.returns is not None
        rows = [(s, e, r) for s, run in enumerate(self.returns) for e, r in enumerate(run)]
        seeds, numbers, returns = zip(*rows, strict=True)
        columns = {"seed": seeds, "episode": numbers, "return": returns}
        return pa.table({**columns, "length": [200] * len(rows)})

    def controller(self, which, index):
        """The heavier, the more it pushes to one side."""
        self.asked = {"which": which, "index": index}
        push = 2.0 if which == "best" else -2.0
        return lambda observation: jnp.asarray([push * ((index or 0) + 1) / 2], observation.dtype)

    def film(self, which, index, seed, max_steps):
        self.asked = {"which": which, "index": index, "seed": seed, "max_steps": max_steps}
        if self.config.environment == "Blind-v0":
            raise ValueError("Blind-v0 has no picture:\n  it knows no rgb_array.")
        shades = np.arange(min(max_steps, 5) + 1, dtype=np.uint8)
        frames = [np.full((41, 61, 3), 20 * shade, np.uint8) for shade in shades]
        return SimpleNamespace(frames=frames, rate=12.5)
