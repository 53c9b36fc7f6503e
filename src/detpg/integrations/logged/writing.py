"""Transitions of one's own as a Parquet file that `read` takes."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from detpg.integrations.logged.assembling import check_inside
from detpg.integrations.logged.ordering import check_labels
from detpg.integrations.logged.parquet import metadata
from detpg.integrations.logged.parts import Part, checked
from detpg.runs.directory import write_atomically
from detpg.types import Bounds


def write(
    path: str | Path,
    *,
    observation: Any,
    action: Any,
    reward: Any,
    terminated: Any,
    truncated: Any = None,
    next_observation: Any = None,
    episode: Any = None,
    bounds: Bounds | None = None,
) -> None:
    """Writes transitions in their order of time; the file is whole or absent.

    Args:
        path: Where; ends in `.parquet`.
        observation: s, shape (N, d).
        action: a as it was carried out, in the world's own units, shape (N, m).
        reward: r, shape (N,).
        terminated: Whether s' is terminal, shape (N,).
        truncated: Whether the episode was cut after this step; nowhere, when not given.
        next_observation: s' before any reset; when not given, `read` takes that of the next row.
        episode: A label of its own for each episode, where the flags do not tell.
        bounds: The box of legal actions.

    Raises:
        ValueError: Lengths that differ, numbers that are not finite, actions outside the bounds.
    """
    path = Path(path)
    if path.suffix != ".parquet":
        raise ValueError(f"{path} does not end in .parquet: give such a name, so that it is found.")
    ended = np.asarray(terminated, bool)
    part = checked(
        Part(
            row=lambda i: f"row {i}",
            observation=_vectors("observation", observation),
            action=_vectors("action", action),
            reward=np.asarray(reward, float),
            terminated=ended,
            truncated=np.zeros_like(ended) if truncated is None else np.asarray(truncated, bool),
            next_observation=None if next_observation is None else np.asarray(next_observation),
            episode=None if episode is None else np.asarray(episode),
        )
    )
    if bounds is not None:
        check_inside(part, bounds)
    if next_observation is None:
        check_labels(part)
    columns = {name: x for name, x in part._asdict().items() if isinstance(x, np.ndarray)}
    table = pa.table({name: _column(x) for name, x in columns.items()})
    if bounds is not None:
        table = table.replace_schema_metadata(metadata(bounds))
    write_atomically(path, lambda file: pq.write_table(table, file, compression="zstd"))


def _vectors(name: str, values: Any) -> np.ndarray:
    array = np.asarray(values, float)
    if array.ndim != 2:
        raise ValueError(
            f"{name} has shape {array.shape}: give one row for each step, shape (steps, size)."
        )
    return array


def _column(values: np.ndarray) -> pa.Array:
    """One number, or a list of fixed size, in each row."""
    if values.ndim == 1:
        return pa.array(values)
    flat = pa.array(np.ascontiguousarray(values).reshape(-1))
    return pa.FixedSizeListArray.from_arrays(flat, values.shape[1])
