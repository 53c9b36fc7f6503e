"""The words beside the committed tables: every number in them is one that the tables give."""

import json
import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from detpg.experiments import STUDIES
from detpg.experiments.claims import Claim
from detpg.experiments.report import claims_page

HERE = Path(__file__).parents[2]
RESULTS = HERE / "results"
NUMBER = r"(-?\d[\d,]*(?:\.\d+)?)"
WITH_INTERVAL = re.compile(rf"{NUMBER} \[{NUMBER},\s{NUMBER}\]")


def summary(name):
    return json.loads((RESULTS / name / "summary.json").read_text())


def claims(name):
    fields = ({**claim, "interval": tuple(claim["interval"])} for claim in summary(name)["claims"])
    return [Claim(**claim) for claim in fields]


def known(names):
    """A mean and the ends of its interval, each row one: of all claims, of the bands."""
    rows = [(claim.measured, *claim.interval) for name in names for claim in claims(name)]
    for name in names:
        bands = pl.read_parquet(RESULTS / name / "bands.parquet").select("mean", "low", "high")
        rows += bands.drop_nulls().rows()
    for path in (RESULTS / "gymnasium").glob("*/final.json"):
        mean = json.loads(path.read_text())["mean"]
        rows.append((mean["value"], *mean["interval"]))
    return np.array(rows, dtype=float)


def value_and_half_a_unit(text):
    """A number as it is written, and by how much it may be rounded."""
    plain = text.replace(",", "")
    if "." in plain:
        return float(plain), 0.5 * 10.0 ** -len(plain.split(".")[1])
    zeros = len(plain) - len(plain.rstrip("0"))
    return float(plain), 0.5 * 10.0 ** (zeros if plain.strip("-0") else 0)


@pytest.mark.parametrize(
    ("path", "names"),
    [
        ("results/figure2/finding.md", ["figure2"]),
        ("results/figure3/finding.md", ["figure3"]),
        ("README.md", ["figure1", "figure2", "figure3"]),
    ],
)
def test_every_interval_that_is_quoted_stands_in_the_tables(path, names):
    quoted, rows = WITH_INTERVAL.findall((HERE / path).read_text()), known(names)
    assert len(quoted) > 5
    for texts in quoted:
        values, halves = np.array([value_and_half_a_unit(text) for text in texts]).T
        near = np.abs(rows - values) <= halves * (1 + 1e-6)
        assert near.all(axis=1).any(), texts


@pytest.mark.parametrize("name", ["figure2", "figure3"])
def test_the_page_of_claims_is_that_of_the_summary(name):
    found = summary(name)
    page = claims_page(
        STUDIES[name], found["preset"], found["seed"], found["selected"], claims(name)
    )
    assert (RESULTS / name / "claims.md").read_text() == page


def test_the_committed_points_of_figure_3_are_those_that_its_sweep_chose():
    chosen = {row["arm"]: row["point"] for row in summary("figure3")["selected"]}
    for arm in STUDIES["figure3"].arms:
        assert not arm.committed or dict(arm.committed) == chosen[arm.name]
