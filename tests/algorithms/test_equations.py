"""Every numbered update of Sections 4.1 to 4.3 stands in the code, at its line, and in the docs."""

import re
from pathlib import Path

import pytest

from detpg.algorithms import ALGORITHMS

ROOT = Path(__file__).parents[2]
UPDATES = (11, 12, 13, *range(16, 28))


@pytest.mark.parametrize("number", UPDATES)
def test_an_update_is_cited_where_it_is_done(number: int):
    comments = [
        line
        for path in (ROOT / "src" / "detpg" / "algorithms").glob("*.py")
        for line in path.read_text().splitlines()
        if line.lstrip().startswith("#") and line.endswith(f"({number})")
    ]
    assert comments, f"no comment in the algorithms ends with ({number})"


def test_the_docs_name_every_update():
    named = (ROOT / "docs" / "reference" / "hyperparameters.md").read_text()
    for algorithm in ALGORITHMS.values():
        assert algorithm.equations in named
    numbers = {int(n) for a in ALGORITHMS.values() for n in re.findall(r"\b\d+\b", a.equations)}
    assert set(UPDATES) <= numbers
