"""The tidy tables of a study.

`sweep.parquet` and `curves.parquet` have one row per learner, problem, point, seed and step; the
small `bands.parquet` (mean and interval at each step) and `scores.parquet` (one row per point) are
what the pictures are drawn from.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from detpg.evaluation.intervals import bootstrap_means
from detpg.experiments.selection import Rule, lost, score
from detpg.experiments.study import Arm, Condition, Phase, Results, Study
from detpg.runs import TableWriter

# Enough for a band a few pixels wide; claims use more.
BAND_RESAMPLES = 999
COUNTS = {"num_runs": pa.int32(), "num_diverged": pa.int32()}
BANDS = {
    "step": pa.int32(),
    **dict.fromkeys(("mean", "low", "high"), pa.float32()),
    **COUNTS,
}
Cells = dict[tuple[Condition, str], np.ndarray]


def write_tables(results: Results, sweep: Cells, directory: Path) -> None:
    """Writes all four tables.

    Args:
        results: Selections and fresh runs.
        sweep: (condition, arm name) -> metric of shape (points, seeds, time).
        directory: Where the tables go.
    """
    study, arms = results.study, {arm.name: arm for arm in results.study.arms}
    shown = study.measured
    runs = {"seed": pa.int32(), "step": pa.int32(), shown: pa.float32(), "finite": pa.bool_()}
    summed = {**dict.fromkeys((f"{rule}_{shown}" for rule in study.rules), pa.float32()), **COUNTS}
    with (
        TableWriter(directory / "sweep.parquet", _schema(study, runs)) as table,
        TableWriter(directory / "scores.parquet", _schema(study, summed)) as scores,
    ):
        for (condition, name), values in sweep.items():
            axes = _axes(results, condition, arms[name], "sweep", values.shape, range(len(values)))
            table.block(axes, _runs(values, study))
            scores.block(axes, _scores(values, study))
    roles = {"role": pa.string()}
    with (
        TableWriter(directory / "curves.parquet", _schema(study, roles | runs)) as table,
        TableWriter(directory / "bands.parquet", _schema(study, roles | BANDS)) as bands,
    ):
        for (condition, name, phase), values in results.costs.items():
            choices = results.selections[condition, name].choices
            points = [choice.index for choice in choices]
            axes = _axes(results, condition, arms[name], phase, values.shape, points)
            axes["role"] = (0, [choice.role for choice in choices])
            table.block(axes, _runs(values, study))
            bands.block(axes | {"step": (1, list(condition.times))}, _bands(values, study))


def _shown(costs: np.ndarray, study: Study) -> np.ndarray:
    """Costs as people read them: returns, where the study measures returns."""
    return -costs if study.measured == "return" else costs


def _runs(values: np.ndarray, study: Study) -> dict[str, np.ndarray]:
    return {study.measured: _shown(values, study), "finite": np.isfinite(values)}


def _scores(values: np.ndarray, study: Study) -> dict[str, np.ndarray]:
    """One row per point: mean score over seeds by each rule, and how many runs diverged."""

    def means(rule: Rule) -> np.ndarray:
        return score(values, rule, study.lost_above, study.num_final).mean(axis=1)

    scores = {f"{rule}_{study.measured}": _shown(means(rule), study) for rule in study.rules}
    diverged = np.sum(lost(values, study.lost_above), axis=1)
    return {**scores, "num_runs": np.full(len(values), values.shape[1]), "num_diverged": diverged}


def _bands(values: np.ndarray, study: Study) -> dict[str, np.ndarray]:
    """Mean over the runs that did not diverge and its 95% interval, shape (roles, time)."""
    num_roles, num_runs, num_times = values.shape
    kept = ~lost(values, study.lost_above)
    bands = {name: np.full((num_roles, num_times), np.nan) for name in ("mean", "low", "high")}
    for role in np.flatnonzero(kept.any(axis=1)):
        runs = _shown(values[role, kept[role]].T.astype(np.float64), study)
        means = bootstrap_means(runs, seed=0, num_resamples=BAND_RESAMPLES)
        bands["mean"][role] = runs.mean(axis=-1)
        bands["low"][role], bands["high"][role] = np.percentile(means, [2.5, 97.5], axis=-1)
    diverged = np.repeat(np.sum(~kept, axis=1)[:, None], num_times, axis=1)
    return {**bands, "num_runs": np.full_like(diverged, num_runs), "num_diverged": diverged}


def _axes(
    results: Results,
    condition: Condition,
    arm: Arm,
    phase: Phase,
    shape: tuple[int, ...],
    points: Sequence[int],
) -> dict[str, Any]:
    """What each entry of a cell's array (points, seeds, time) stands for."""
    axes: dict[str, Any] = {
        "study": results.study.name,
        **dict(condition.columns),
        "arm": arm.name,
        "algorithm": arm.algorithm,
        "phase": phase,
        "point": (0, list(points)),
        "seed": (1, list(range(shape[1]))),
        "step": (2, list(condition.times)),
    }
    grid = results.points[arm.name]
    for name in _hyper_names(results.study):
        taken = [float(grid[name][point]) if name in grid else None for point in points]
        axes[name] = (0, taken)
    return axes


def _hyper_names(study: Study) -> list[str]:
    return sorted({name for arm in study.arms for name, _ in arm.grid})


def _schema(study: Study, columns: dict[str, pa.DataType]) -> pa.Schema:
    """The columns that say what was run, then the given ones."""
    kinds: dict[str, pa.DataType] = {"study": pa.string()}
    for name, value in study.conditions[0].columns:
        kinds[name] = pa.int32() if isinstance(value, int) else pa.string()
    kinds |= dict.fromkeys(("arm", "algorithm", "phase"), pa.string())
    kinds |= {"point": pa.int32()}
    kinds |= dict.fromkeys(_hyper_names(study), pa.float64())
    return pa.schema(list((kinds | columns).items()))
