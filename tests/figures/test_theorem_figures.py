"""Pictures of the checks, drawn from the small table that stands in `results/`."""

import shutil
from pathlib import Path

import pytest
from matplotlib.image import imread

from detpg.figures import FIGURES, draw, missing

RESULTS = Path(__file__).parents[2] / "results" / "theorems"


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("theorems")
    shutil.copy(RESULTS / "points.csv", directory)
    assert missing("theorems", directory) == list(FIGURES["theorems"][0])
    draw("theorems", directory)
    return directory


def test_every_picture_is_there_and_readable(drawn: Path):
    assert missing("theorems", drawn) == []
    for picture in drawn.glob("*.png"):
        height, width = imread(picture).shape[:2]
        assert width >= 1000
        assert height >= 600


def test_the_committed_pictures_are_these(drawn: Path):
    for picture in drawn.glob("*.svg"):
        assert (RESULTS / picture.name).exists()


def test_axes_are_named_as_people_write(drawn: Path):
    text = (drawn / "theorem-2.svg").read_text()
    for words in ("σ, width of the policy (action units)", "slope of σ²", "a Gaussian"):
        assert words in text
    assert "bars: 4 standard errors" in (drawn / "behaviour.svg").read_text()
