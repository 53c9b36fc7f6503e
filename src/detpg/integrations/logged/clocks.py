"""Columns that tell order, whatever their type, as numbers that can be compared exactly."""

import json
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from detpg.integrations.logged import names

TEXTS = (pa.int64(), pa.float64(), pa.timestamp("us"), pa.timestamp("us", "UTC"))


class Clock(NamedTuple):
    """A column that tells order.

    Attributes:
        name: Of the column.
        values: Shape (rows,): integers, or floats where they are given.
        say: The value of a row, as it stands in the column.
        is_date: Whether it may stay while another one goes on.
    """

    name: str
    values: np.ndarray
    say: Callable[[int], str]
    is_date: bool


def clocks(file: object, table: pa.Table) -> list[Clock]:
    """Those that tell time; where none does, those that tell the place of a row.

    Raises:
        ValueError: A column in which a row has no value, or text that is no time.
    """
    others = [name for name in table.column_names if name not in names.KNOWN]
    times = [one for one in others if names.is_time(one) or pa.types.is_temporal(_type(table, one))]
    indices, stated = _pandas_index(table)
    if times:
        found = [clock(file, name, _whole(table, name)) for name in times]
    else:
        places = [one for one in others if names.is_place(one) or one in indices]
        found = [clock(file, name, _whole(table, name)) for name in places]
        found += [clock(file, "pandas' index", stated)] if stated is not None else []
    return [one for one in found if one is not None]


def clock(file: object, name: str, column: pa.Array) -> Clock | None:
    """A column as a clock; none if it tells no order.

    Raises:
        ValueError: A row has no value, or text that is no time.
    """
    column = column.dictionary_decode() if pa.types.is_dictionary(column.type) else column
    if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
        column = _from_text(file, name, column)
    numeric = pa.types.is_integer(column.type) or pa.types.is_floating(column.type)
    if pa.types.is_decimal(column.type):
        values = column.cast(pa.float64())
    elif pa.types.is_temporal(column.type) and not pa.types.is_interval(column.type):
        values = column.view(pa.int32() if column.type.bit_width == 32 else pa.int64())
    elif numeric:
        values = column
    else:
        return None
    lost = column.is_null(nan_is_null=numeric).to_numpy(zero_copy_only=False)
    if lost.any():
        raise ValueError(
            f"{name} is empty in row {np.argmax(lost)} of {file}: give every row its place in "
            "time, or leave the column out."
        )
    numbers = values.to_numpy(zero_copy_only=False)
    if len(numbers) > 2 and np.all(numbers == numbers[0]) and not names.is_only_time(name):
        return None  # a duration, say
    is_date = names.is_date(name) or pa.types.is_date(column.type)
    return Clock(name, numbers, lambda i: str(column[i]), is_date)


def _from_text(file: object, name: str, column: pa.Array) -> pa.Array:
    for kind in TEXTS:
        try:
            return column.cast(kind)
        except pa.ArrowInvalid:
            continue
    raise ValueError(
        f"{name} in {file} is text, {str(column[0])!r}, and tells no order: give numbers, "
        "datetimes or ISO 8601, or leave the column out."
    )


def _type(table: pa.Table, name: str) -> pa.DataType:
    return table.schema.field(name).type


def _whole(table: pa.Table, name: str) -> pa.Array:
    found = table.column(name).combine_chunks()
    return found if isinstance(found, pa.Array) else pa.concat_arrays(found.chunks)


def _pandas_index(table: pa.Table) -> tuple[list[str], pa.Array | None]:
    """Columns that pandas says are the index; and one that it keeps as a range alone."""
    try:
        said = json.loads((table.schema.metadata or {})[b"pandas"])["index_columns"]
        columns = [one for one in said if isinstance(one, str) and one in table.column_names]
        ranges = [one for one in said if isinstance(one, dict) and one.get("kind") == "range"]
        rows = [np.arange(one["start"], one["stop"], one["step"]) for one in ranges]
    except (KeyError, TypeError, ValueError):
        return [], None
    fitting = [pa.array(one) for one in rows if len(one) == len(table)]
    return columns, fitting[0] if fitting else None
