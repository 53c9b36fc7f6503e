"""What a run has measured: a row for each seed and interval, a row for each episode played."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from detpg.runs import write_atomically
from detpg.workbench.play import Played

METRICS, EVALUATIONS = "metrics.parquet", "evaluations.parquet"
# The names that people know from other libraries.
MEASURED = (
    "rollout/ep_rew_mean",
    "rollout/ep_len_mean",
    "train/td_error",
    "train/value",
    "train/saturated",
    "train/exploration",
    "eval/mean_reward",
    "eval/mean_ep_length",
    "eval/value_bias",
    "eval/value_scale",
    "train/policy_change",
)
METRICS_SCHEMA = pa.schema(
    [("seed", pa.int32()), ("step", pa.int64()), *((name, pa.float64()) for name in MEASURED)]
)
EVALUATIONS_SCHEMA = pa.schema(
    [
        ("seed", pa.int32()),
        ("step", pa.int64()),
        ("episode", pa.int32()),
        ("return", pa.float64()),
        ("length", pa.int32()),
    ]
)


def read_meter(meter: Any, acted: bool) -> list[dict[str, float | None]]:
    """A row of metrics for each seed; None where no episode ended.

    Args:
        meter: `wrappers.Meter`, seeds first.
        acted: Whether the learner lived the episodes; logged transitions are in no order.
    """
    sums = {name: np.asarray(getattr(meter, name), float) for name in meter.__dataclass_fields__}
    steps, updates = (np.maximum(sums[name], 1.0) for name in ("steps", "updates"))
    means = {
        "train/td_error": np.sqrt(sums["squared_errors"] / updates),
        "train/value": sums["values"] / updates,
        "train/saturated": sums["saturated"] / steps,
        "train/exploration": np.sqrt(sums["deviations"] / steps),
    }
    rows: list[dict[str, float | None]] = []
    for i, episodes in enumerate(sums["episodes"]):
        row: dict[str, float | None] = {name: float(found[i]) for name, found in means.items()}
        for name, column in (("rew", "returns"), ("len", "lengths")):
            mean = float(sums[column][i] / episodes) if episodes and acted else None
            row[f"rollout/ep_{name}_mean"] = mean
        rows.append(row)
    return rows


def metrics_table(rows: list[dict[str, Any]]) -> pa.Table:
    """Rows of metrics; what a row does not name is null."""
    return pa.Table.from_pylist(
        [{name: row.get(name) for name in METRICS_SCHEMA.names} for row in rows], METRICS_SCHEMA
    )


def evaluations_table(played: Played, step: int) -> pa.Table:
    """A row for each episode of each learner."""
    seeds, episodes = played.returns.shape
    columns = (
        np.repeat(np.arange(seeds), episodes),
        np.full(seeds * episodes, step),
        np.tile(np.arange(episodes), seeds),
        played.returns.ravel(),
        played.lengths.ravel().astype(int),
    )
    arrays = [pa.array(column, field.type) for column, field in zip(columns, EVALUATIONS_SCHEMA)]
    return pa.Table.from_arrays(arrays, schema=EVALUATIONS_SCHEMA)


def write_table(path: Path, table: pa.Table) -> None:
    """Writes a table whole."""
    write_atomically(path, lambda file: pq.write_table(table, file, compression="zstd"))


def read_table(path: Path, schema: pa.Schema, until: int) -> pa.Table:
    """The rows up to a step; none where the file is absent or damaged."""
    try:
        table = pq.read_table(path, schema=schema)
    except (OSError, pa.ArrowException):
        return schema.empty_table()
    return table.filter(np.asarray(table["step"]) <= until)
