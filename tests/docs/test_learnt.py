"""What the page says was learnt on Gymnasium's tasks is what the committed evaluations give."""

import json
import re
from pathlib import Path

import polars as pl
import pytest

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "results" / "gymnasium"
ROW = re.compile(
    r"^\|\s+(?:`(?P<world>[^`]+)`\s)?\| `(?P<learner>[^`]+)`[^|]* \| (?P<steps>[\d,]+) \| "
    r"(?P<mean>\S+) \[(?P<low>\S+), (?P<high>\S+)\] \| "
    r"(?P<solved>\d+) of 10 \| (?P<first>[^|]+) \|$"
)


def number(words):
    return float(words.replace(",", ""))


def rows():
    world, found = None, []
    for line in (ROOT / "docs" / "choosing.md").read_text().splitlines():
        if match := ROW.match(line):
            world = match["world"] or world
            found.append((world, match))
    return found


def test_every_run_has_its_row():
    named = {f"{match['learner']}-{world}" for world, match in rows()}
    assert named == {path.name for path in RESULTS.iterdir() if path.is_dir()}


@pytest.mark.parametrize(("world", "row"), rows(), ids=lambda x: x if isinstance(x, str) else "")
def test_its_numbers_are_those_of_the_tables(world, row):
    folder = RESULTS / f"{row['learner']}-{world}"
    final = json.loads((folder / "final.json").read_text())
    quoted = [number(row[name]) for name in ("mean", "low", "high")]
    measured = [final["mean"]["value"], *final["mean"]["interval"]]
    assert quoted == pytest.approx(measured, abs=0.05 + 1e-9)
    assert int(row["solved"]) == sum(mean >= final["threshold"] for mean in final["seeds"])
    table = pl.read_parquet(folder / "evaluations.parquet")
    assert number(row["steps"]) == table["step"].max()
    means = table.group_by("seed", "step").agg(pl.col("return").mean())
    solved = means.filter(pl.col("return") >= final["threshold"]).group_by("seed").min()
    if row["first"] == "never":
        assert not len(solved)
    else:
        ends = [number(x) * 1000 for x in row["first"].split(" to ")]
        assert ends == [solved["step"].min(), solved["step"].max()]
