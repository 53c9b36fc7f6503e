"""Pictures drawn from the small tables that stand in `results/`."""

import shutil
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from matplotlib.image import imread

from detpg.figures import FIGURES, draw, missing

RESULTS = Path(__file__).parents[2] / "results" / "figure1"


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("figure1")
    for table in ("bands.parquet", "scores.parquet"):
        shutil.copy(RESULTS / table, directory)
    assert missing("figure1", directory) == list(FIGURES["figure1"][0])
    draw("figure1", directory)
    return directory


def test_every_file_is_there(drawn: Path):
    assert missing("figure1", drawn) == []
    assert (drawn / "figure1.pdf").read_bytes().startswith(b"%PDF")


def test_pictures_are_large_enough_to_read(drawn: Path):
    for name in FIGURES["figure1"][0]:
        if name.endswith(".png"):
            height, width = imread(drawn / name).shape[:2]
            assert width == 1600
            assert height >= 600


def test_the_vector_picture_says_what_it_shows(drawn: Path):
    text = (drawn / "figure1.svg").read_text()
    ET.fromstring(text)
    # Text is drawn as paths; matplotlib leaves the words as comments.
    for words in ("m = 10", "m = 50", "environment steps", "Silver et al. (2014)", "COPDAC-B"):
        assert words in text
