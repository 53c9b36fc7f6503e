from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from detpg.runs import TableWriter

SCHEMA = pa.schema(
    [("arm", pa.string()), ("point", pa.int32()), ("seed", pa.int32()), ("cost", pa.float32())]
)


def write(path: Path) -> None:
    with TableWriter(path, SCHEMA) as table:
        cost = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, np.inf]])
        axes = {"arm": "a", "point": (0, [7, 9]), "seed": (1, [0, 1, 2]), "step": (2, [])}
        table.block(axes, {"cost": cost})


def test_rows_are_tidy(tmp_path: Path):
    write(tmp_path / "t.parquet")
    rows = pq.read_table(tmp_path / "t.parquet").to_pylist()
    assert [(r["arm"], r["point"], r["seed"], r["cost"]) for r in rows] == [
        ("a", 7, 0, 1.0),
        ("a", 7, 1, 2.0),
        ("a", 7, 2, 3.0),
        ("a", 9, 0, 4.0),
        ("a", 9, 1, 5.0),
        ("a", 9, 2, np.inf),
    ]


def test_the_same_blocks_give_the_same_bytes(tmp_path: Path):
    write(tmp_path / "a.parquet")
    write(tmp_path / "b.parquet")
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()


def test_an_interrupted_table_leaves_nothing(tmp_path: Path):
    with (
        pytest.raises(KeyboardInterrupt),
        TableWriter(tmp_path / "t.parquet", SCHEMA),
    ):
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []
