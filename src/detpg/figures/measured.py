"""What a run directory of `detpg train` holds of one measure, as a curve for each seed."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

EVALUATED = ("return", "length")
_INDEX = ("seed", "step")


@dataclasses.dataclass(frozen=True)
class Curve:
    """A measure of one run over time.

    Attributes:
        path: The run directory.
        environment: Where it learnt.
        algorithm: What learnt.
        metric: The measure.
        steps: Environment steps, shape (time,).
        seeds: The seeds trained side by side, shape (seeds,).
        values: Shape (time, seeds).
    """

    path: Path
    environment: str
    algorithm: str
    metric: str
    steps: np.ndarray
    seeds: np.ndarray
    values: np.ndarray

    @property
    def kept(self) -> np.ndarray:
        """Which seeds stayed finite, shape (seeds,)."""
        return np.all(np.isfinite(self.values), axis=0)

    @property
    def num_seeds(self) -> int:
        return len(self.seeds)

    @property
    def num_kept(self) -> int:
        return int(self.kept.sum())


def read(path: Path, metric: str) -> Curve:
    """The curve of a run.

    Args:
        path: A run directory.
        metric: "return" or "length": of the evaluations, the mean over the episodes of each; or
            a column of `metrics.parquet`.

    Raises:
        ValueError: Not a run, no such metric, or nothing measured yet.
    """
    config = _config(path)
    rows = _evaluations(path, config, metric) if metric in EVALUATED else _metrics(path, metric)
    wide = rows.pivot(on="seed", index="step", values="value", sort_columns=True).sort("step")
    # Where a seed has nothing yet, no statistic over seeds can be formed.
    wide = wide.drop_nulls()
    if not wide.height:
        raise ValueError(f"{path} has no {metric} of every seed yet: wait, then plot it again.")
    seeds = [name for name in wide.columns if name != "step"]
    return Curve(
        path=path,
        environment=str(config["environment"]),
        algorithm=str(config["algorithm"]),
        metric=metric,
        steps=wide["step"].to_numpy(),
        seeds=np.asarray([int(seed) for seed in seeds]),
        values=wide.select(seeds).to_numpy(),
    )


def _config(path: Path) -> dict[str, Any]:
    try:
        config = json.loads((path / "config.json").read_text())
    except (OSError, ValueError):
        config = None
    if not isinstance(config, dict) or not {"detpg", "algorithm", "environment"} <= config.keys():
        raise ValueError(f"{path} is not a run: name a folder that `detpg train` has written.")
    return config


def _table(path: Path, name: str) -> pl.DataFrame | None:
    """A table of the run; None where it is missing, empty or damaged."""
    try:
        table = pl.read_parquet(path / name)
    except (OSError, pl.exceptions.PolarsError):
        return None
    return table if table.height else None


def _evaluations(path: Path, config: dict[str, Any], metric: str) -> pl.DataFrame:
    table = _table(path, "evaluations.parquet")
    if table is None:
        run = config.get("run", {})
        if run.get("environment", "") is None or run.get("evaluation_episodes") == 0:
            what = "logged data alone" if run.get("environment", "") is None else "no evaluations"
            raise ValueError(
                f"{path} has {what} and no {metric}: plot what training measured, such as --metric "
                "train/td_error."
            )
        raise ValueError(f"{path} has not been evaluated yet: wait for its first evaluation.")
    value = pl.col(metric).cast(pl.Float64).mean().alias("value")
    return table.group_by(*_INDEX).agg(value)


def _metrics(path: Path, metric: str) -> pl.DataFrame:
    """A column of what was measured while learning; where a cell is empty, what it was before."""
    table = _table(path, "metrics.parquet")
    measured = [] if table is None else [name for name in table.columns if name not in _INDEX]
    if table is None or metric not in measured:
        known = ", ".join((*EVALUATED, *measured))
        raise ValueError(f"{path} has no metric {metric!r}: choose from {known}.")
    value = pl.col(metric).cast(pl.Float64).forward_fill().over("seed").alias("value")
    return table.sort(*_INDEX).select(*_INDEX, value)
