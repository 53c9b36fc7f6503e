"""The files of `detpg verify`: numbers as people read them, tables, the page."""

import csv
import json

import pytest

from detpg.theorems import Group
from detpg.theorems.record import check, points
from detpg.theorems.report import as_json, columns, number, page, table, write


@pytest.fixture
def groups() -> dict[str, Group]:
    checks = (
        check("a/good", "the norm |x| is 2", 1.99, 2.0, 0.02),
        check("a/bad", "many are right", [1.0, 2.5], [1.0, 2.0], 0.1),
        check("a/far", "far off", 0.4, 0.1, 0.0, "at least"),
    )
    rows = points("x (units)", "y", "a line", [1, 2], [0.1, 1 / 3], 0.01)
    return {"a": Group("The title", checks, rows)}


@pytest.mark.parametrize(
    ("value", "tolerance", "text"),
    [
        (0.0, 0.1, "0"),
        (1.99997, 6.8e-5, "1.99997"),
        (-0.508, 0.047, "-0.508"),
        (1.3e-16, 5e-14, "1.3e-16"),
        (0.44611, 0.0, "0.446"),
        (1.66e23, 0.0, "1.66e+23"),
        (2.0, 4e-6, "2"),
        (float("nan"), 0.1, "not finite"),
        (1234.567, 30.0, "1235"),
    ],
)
def test_as_many_digits_as_mean_something(value: float, tolerance: float, text: str):
    assert number(value, tolerance) == text


def test_columns_show_the_relation(groups):
    assert [columns(c) for c in groups["a"].checks] == [
        ("1.99", "2", "0.02"),
        ("1, 2.5", "1, 2", "0.1"),
        ("0.4", "≥ 0.1", "-"),
    ]


def test_the_page_has_a_row_for_each_check(groups):
    text = page(groups)
    assert "2 of 3 checks passed" in text
    assert "| `a/good` | the norm \\|x\\| is 2 | 1.99 | 2 | 0.02 | yes |" in text
    assert "| `a/bad` | many are right | 1, 2.5 | 1, 2 | 0.1 | **no** |" in text
    assert "--8<-- [start:a]" in text
    assert "--8<-- [end:a]" in text


def test_the_table_is_tidy(groups):
    rows = list(csv.DictReader(table(groups).splitlines()))
    assert rows[1] == {
        "group": "a",
        "x_name": "x (units)",
        "y_name": "y",
        "series": "a line",
        "x": "2",
        "y": "0.33333333",
        "error": "0.01",
    }


def test_files_are_written_whole(groups, tmp_path):
    write(groups, tmp_path)
    assert {p.name for p in tmp_path.iterdir()} == {"checks.json", "checks.md", "points.csv"}
    kept = json.loads((tmp_path / "checks.json").read_text())
    assert kept["checks"] == as_json(groups)["checks"]
    assert kept["provenance"]["versions"]["detpg"]
