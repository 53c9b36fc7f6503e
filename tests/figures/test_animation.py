"""Films are read back: their size, their pace, their colours."""

import sys

import numpy as np
import pytest

from detpg.figures.animation import animate
from films import read_gif, read_mp4

RED, BLUE = (200, 30, 30), (30, 30, 200)


def painted(colour, height=40, width=60):
    return np.full((height, width, 3), colour, np.uint8)


@pytest.fixture
def mp4(tmp_path):
    """Reads the bytes of a film."""

    def read(content):
        (tmp_path / "film.mp4").write_bytes(content)
        return read_mp4(tmp_path / "film.mp4")

    return read


def test_mp4(mp4):
    pictures, fps = mp4(animate([painted(RED), painted(BLUE)], fps=12.5))
    assert fps == 12.5
    assert [picture.shape for picture in pictures] == [(40, 60, 3)] * 2
    for picture, colour in zip(pictures, (RED, BLUE), strict=True):
        np.testing.assert_allclose(picture[20, 30], colour, atol=6)


@pytest.mark.parametrize("size", [(41, 61), (1, 1)])
def test_odd_sizes_lose_nothing(size, mp4):
    picture = painted(BLUE, *size)
    picture[-1, -1] = RED
    (seen,), _ = mp4(animate([picture]))
    assert seen.shape == (size[0] + 1, size[1] + 1, 3)
    r, _, b = seen[-2:, -2:].reshape(4, 3).mean(0)
    assert r > b  # the square of the corner is red
    (seen,), _ = read_gif(animate([picture], "gif"))
    np.testing.assert_array_equal(seen, picture)


def test_smaller_frames_lie_in_the_corner_of_the_largest(mp4):
    frames = [painted(RED, 20, 60), painted(BLUE, 40, 30)]
    for pictures in (read_gif(animate(frames, "gif"))[0], mp4(animate(frames))[0]):
        assert {picture.shape for picture in pictures} == {(40, 60, 3)}
        np.testing.assert_allclose(pictures[0][10, 45], RED, atol=6)
        np.testing.assert_allclose(pictures[1][10, 45], 0, atol=6)


@pytest.mark.parametrize(
    ("fps", "seconds"),
    [(10, [0.1] * 6), (30, [0.03, 0.04, 0.03, 0.03, 0.04, 0.03]), (100, [0.02] * 3), (7.5, None)],
)
def test_a_gif_takes_as_long_as_it_should(fps, seconds):
    shades = [painted((40 * shade,) * 3) for shade in range(6)]
    pictures, shown = read_gif(animate(shades, "gif", fps))
    assert sum(shown) == pytest.approx(6 / fps, abs=0.005)
    assert seconds is None or shown == seconds
    np.testing.assert_array_equal(pictures[1][0, 0], 80 if fps == 100 else 40)


def test_what_cannot_be_made_is_one_sentence(monkeypatch):
    with pytest.raises(ValueError, match=r"^0 frames as 'mp4': give 1 or more, as mp4 or gif[.]$"):
        animate([])
    with pytest.raises(ValueError, match=r"^1 frames as 'avi': "):
        animate([painted(RED)], "avi")
    with pytest.raises(ValueError, match=r"^ffmpeg: .*[.]$"):
        animate([painted(RED)], fps=0)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(ModuleNotFoundError, match=r"needs imageio-ffmpeg: pip install .*[.]$"):
        animate([painted(RED)])
