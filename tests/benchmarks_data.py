"""The reference data of the control tasks (tests/fixtures/benchmarks)."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np

FOLDER = Path(__file__).parent / "fixtures" / "benchmarks"


def columns(name: str) -> dict[str, np.ndarray]:
    """A table by column, empty cells as NaN."""
    with (FOLDER / f"{name}.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([float(row[key] or "nan") for row in rows]) for key in rows[0]}


def vectors(table: dict[str, np.ndarray], prefix: str) -> np.ndarray:
    """Columns s0, s1, ... side by side."""
    names = [name for name in (f"{prefix}0", f"{prefix}1") if name in table]
    return np.stack([table[name] for name in names], axis=1)


def document(name: str) -> dict[str, Any]:
    """A file of nested records."""
    return json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
