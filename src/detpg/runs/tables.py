"""Tidy tables as Parquet files, written block by block and published whole."""

import os
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq


class TableWriter:
    """A Parquet file in the making: `block` by `block`, in place only once it is whole.

    The same blocks give the same bytes.
    """

    def __init__(self, path: Path, schema: pa.Schema):
        """Opens a hidden file beside `path`."""
        self.path = path
        self._partial = path.with_name(f".{path.name}.{os.getpid()}.part")
        self._schema = schema
        self._writer = pq.ParquetWriter(self._partial, schema, compression="zstd")

    def block(self, axes: Mapping[str, Any], values: Mapping[str, np.ndarray]) -> None:
        """Adds one row for each entry of the value arrays.

        Args:
            axes: Column -> a constant, or (axis, entries along that axis of the values); those
                that the schema does not name are passed over.
            values: Column -> array; all of one shape.
        """
        shape = next(iter(values.values())).shape
        arrays = [
            pa.array(np.ravel(values[field.name])).cast(field.type)
            if field.name in values
            else _spread(axes[field.name], shape).cast(field.type)
            for field in self._schema
        ]
        self._writer.write_table(pa.Table.from_arrays(arrays, schema=self._schema))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._writer.close()
        if kind is None:
            with self._partial.open("rb") as file:
                os.fsync(file.fileno())
            self._partial.replace(self.path)
        else:
            self._partial.unlink(missing_ok=True)


def _spread(entry: Any, shape: tuple[int, ...]) -> pa.Array:
    """A column of length prod(shape) from a constant or from entries along one axis."""
    axis, entries = entry if isinstance(entry, tuple) else (0, [entry] * shape[0])
    position = np.arange(shape[axis], dtype=np.int32)
    index = np.broadcast_to(
        np.expand_dims(position, [i for i in range(len(shape)) if i != axis]), shape
    )
    return pa.DictionaryArray.from_arrays(pa.array(np.ravel(index)), pa.array(entries)).cast(
        pa.array(entries).type
    )
