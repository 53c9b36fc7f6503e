"""Every equation that an algorithm names stands at its line, in its file, and in the docs."""

import inspect
import re
from pathlib import Path

import pytest

from detpg.algorithms import ALGORITHMS

ROOT = Path(__file__).parents[2]
UPDATES = (11, 12, 13, *range(16, 28))


def named(equations: str) -> set[int]:
    """The numbers of the paper's equations in a text, which may name sections too."""
    return {int(n) for n in re.findall(r"\b\d+\b", re.sub(r"Section [\d.]+", "", equations))}


@pytest.mark.parametrize("name", ALGORITHMS)
def test_an_equation_is_cited_where_it_is_done(name: str):
    """In the algorithm's own file, at the end of a comment."""
    algorithm = ALGORITHMS[name]
    comments = re.findall(
        r"^ +# .*\(([\d, ]+)\)$", Path(inspect.getfile(algorithm)).read_text(), re.MULTILINE
    )
    cited = {int(number) for comment in comments for number in comment.split(",")}
    assert cited == named(algorithm.equations)


def test_every_update_has_an_algorithm_and_the_docs_name_it():
    page = (ROOT / "docs" / "reference" / "hyperparameters.md").read_text()
    for algorithm in ALGORITHMS.values():
        assert algorithm.equations in page
    assert set(UPDATES) <= set().union(*(named(a.equations) for a in ALGORITHMS.values()))
