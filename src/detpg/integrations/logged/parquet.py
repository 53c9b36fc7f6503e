"""Transitions in Parquet files: the columns, and what the schema says of the actions."""

import json
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from detpg.integrations.logged import names
from detpg.integrations.logged.clocks import clocks
from detpg.integrations.logged.parts import Part, ends
from detpg.types import Bounds

# In the schema's metadata: {"action_low": [...], "action_high": [...]}, null where unbounded.
MARK = b"detpg"


def parts(files: Sequence[Path]) -> tuple[list[Part], Bounds | None]:
    """Each file, and the bounds of the actions if one of them names any.

    Raises:
        ValueError: What is no Parquet file or lacks a column; bounds that disagree.
    """
    found, bounds = [], None
    for file in files:
        table = _opened(file)
        said = _bounds(file, table.schema)
        if None not in (said, bounds) and said != bounds:
            raise ValueError(f"{file} has other action bounds than {files[0]}: give data of one.")
        bounds = said if bounds is None else bounds
        found.append(_part(file, table))
    return found, bounds


def metadata(bounds: Bounds) -> dict[bytes, bytes]:
    """What `parts` finds again."""
    ends = [[x if math.isfinite(x) else None for x in end] for end in bounds]
    return {MARK: json.dumps(dict(zip(("action_low", "action_high"), ends))).encode()}


def _opened(file: Path) -> pa.Table:
    try:
        return pq.ParquetFile(file).read()
    except (pa.ArrowException, OSError) as error:
        raise ValueError(
            f"{file} cannot be read as a Parquet file ({str(error).splitlines()[0]}): write one "
            "with detpg.integrations.logged.write, pyarrow, polars or pandas."
        ) from error


def _bounds(file: Path, schema: pa.Schema) -> Bounds | None:
    text = (schema.metadata or {}).get(MARK)
    if text is None:
        return None
    try:
        said = json.loads(text)
        low = [-math.inf if x is None else float(x) for x in said["action_low"]]
        high = [math.inf if x is None else float(x) for x in said["action_high"]]
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(
            f"The schema of {file} has metadata {MARK.decode()!r} that cannot be read: give "
            '{"action_low": [...], "action_high": [...]}.'
        ) from error
    return Bounds(tuple(low), tuple(high))


def _part(file: Path, table: pa.Table) -> Part:
    present = table.column_names
    names.check(file, present)
    optional = {
        name: read(file, table, name)
        for name, read in (("next_observation", _vectors), ("episode", _labels))
        if name in present or names.numbered(present, name)
    }
    none = np.zeros(len(table), bool)
    part = Part(
        row=lambda i: f"row {i} of {file}",
        observation=_vectors(file, table, "observation"),
        action=_vectors(file, table, "action"),
        reward=_numbers(file, "reward", _column(file, table, "reward")),
        terminated=_flags(file, table, "terminated"),
        truncated=_flags(file, table, "truncated") if "truncated" in present else none,
        clocks=clocks(file, table),
        **optional,
    )
    if not optional:
        _check_groups(file, table, ends(part))
    return part


def _check_groups(file: Path, table: pa.Table, over: np.ndarray) -> None:
    """Refuses a column that tells episodes apart which nothing that is read does."""
    for name in filter(names.is_group, table.column_names):
        label = table.column(name).to_numpy()
        changes = (label[1:] != label[:-1]) & (label[1:] == label[1:]) & ~over[:-1]
        if changes.any():
            i = int(np.argmax(changes))
            raise ValueError(
                f"{name} goes from {label[i]} to {label[i + 1]} in row {i + 1} of {file}, where no "
                "episode ends: name it episode and sort the rows by it and then by time, or leave "
                "it out if the row is the next step all the same."
            )


def _column(file: Path, table: pa.Table, name: str) -> pa.Array:
    """A column without gaps.

    Raises:
        ValueError: It is not there, or a row of it is empty.
    """
    if name not in table.column_names:
        vector = f" or {name}_0, {name}_1, ..." if name in ("observation", "action") else ""
        raise ValueError(
            f"{file} has no column {name}{vector}: it has {', '.join(table.column_names)}, and "
            "observation, action, reward and terminated are needed."
        )
    chunks = table.column(name).chunks
    column = pa.concat_arrays(chunks) if chunks else pa.array([], table.schema.field(name).type)
    if column.null_count:
        (row, *_) = np.flatnonzero(column.is_null().to_numpy(zero_copy_only=False))
        raise ValueError(f"{name} is empty in row {row} of {file}: give every row a value.")
    return column


def _vectors(file: Path, table: pa.Table, name: str) -> np.ndarray:
    """A column of lists, columns `name_0`, `name_1`, ..., or one number in each row."""
    if name not in table.column_names and names.numbered(table.column_names, name):
        columns = [(one, _column(file, table, one)) for one in _numbered(file, table, name)]
        return np.stack([_numbers(file, *column) for column in columns], axis=1)
    column = _column(file, table, name)
    if pa.types.is_fixed_size_list(column.type):
        size = column.type.list_size
    elif pa.types.is_list(column.type) or pa.types.is_large_list(column.type):
        size = _length(file, name, column)
    else:
        return _numbers(file, name, column)[:, None]
    if not size:
        raise ValueError(f"{name} is a list of no entries in {file}: give at least one.")
    return _numbers(file, name, column.flatten(), size).reshape(-1, size)


def _numbered(file: Path, table: pa.Table, name: str) -> list[str]:
    """The columns of the components, in their order."""
    found = set(names.numbered(table.column_names, name))
    expected = [f"{name}_{i}" for i in range(len(found))]
    missing = [one for one in expected if one not in found]
    if missing:
        raise ValueError(
            f"{file} has the columns {', '.join(sorted(found))}, but no {missing[0]}: number the "
            "components from 0 without gaps."
        )
    return expected


def _length(file: Path, name: str, column: pa.Array) -> int:
    """Of each list; they must all have the same."""
    lengths = np.asarray(column.value_lengths())
    wrong = np.flatnonzero(lengths != lengths[:1])
    if wrong.size:
        raise ValueError(
            f"{name} has {lengths[wrong[0]]} entries in row {wrong[0]} of {file}, but {lengths[0]} "
            "in row 0: give lists of one length."
        )
    return int(lengths[0]) if lengths.size else 1


def _numbers(file: Path, name: str, column: pa.Array, size: int = 1) -> np.ndarray:
    """A column of numbers, or the entries of lists of that size."""
    if not (pa.types.is_floating(column.type) or pa.types.is_integer(column.type)):
        raise ValueError(
            f"{name} in {file} is of type {column.type}: give numbers, lists of numbers, or one "
            f"column of numbers for each component ({name}_0, {name}_1, ...)."
        )
    if column.null_count:
        (entry, *_) = np.flatnonzero(column.is_null().to_numpy(zero_copy_only=False))
        raise ValueError(
            f"{name} has an empty entry in row {entry // size} of {file}: give every row a value."
        )
    return column.to_numpy(zero_copy_only=False)


def _flags(file: Path, table: pa.Table, name: str) -> np.ndarray:
    column = _column(file, table, name)
    if pa.types.is_boolean(column.type) or pa.types.is_integer(column.type):
        values = column.to_numpy(zero_copy_only=False)
        if np.isin(values, (0, 1)).all():
            return values.astype(bool)
    raise ValueError(f"{name} in {file} is of type {column.type}: give booleans, or 0 and 1.")


def _labels(file: Path, table: pa.Table, name: str) -> np.ndarray:
    column = _column(file, table, name)
    if pa.types.is_nested(column.type):
        raise ValueError(
            f"{name} in {file} is of type {column.type}: give one number or text in each row."
        )
    return column.to_numpy(zero_copy_only=False)
