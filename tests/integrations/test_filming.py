"""Whatever a world draws is filmed as it is meant, or refused in one sentence."""

import numpy as np
import pytest
from PIL import Image
from points import Point

from detpg.integrations.gymnasium.filming import FASTEST, SLOWEST, Film, frame_rate
from detpg.integrations.gymnasium.worlds import open_worlds

RGB = np.random.default_rng(0).integers(0, 256, (6, 8, 3), np.uint8)
RGB[0, 0], RGB[0, 1] = 0, 255
GREY = RGB[..., :1]
AS_GREY = np.repeat(GREY, 3, axis=-1)
OPAQUE = np.concatenate([RGB, np.full((6, 8, 1), 255, np.uint8)], axis=-1)
FITTING = "let render() return uint8 of shape (height, width, 3)."


def filmed(*drawn):
    film = Film("Mine-v0", 20)
    for frame in drawn:
        film.add(frame)
    for frame in film.frames:
        assert (frame.dtype, frame.ndim, frame.shape[-1]) == (np.uint8, 3, 3)
        assert frame.flags.c_contiguous
    return film.frames


def read_only(array):
    array = array.copy()
    array.flags.writeable = False
    return array


@pytest.mark.parametrize(
    ("drawn", "seen"),
    [
        (RGB, RGB),
        (read_only(RGB), RGB),
        (RGB[::-1, ::-1], RGB[::-1, ::-1]),
        (np.asfortranarray(RGB), RGB),
        (RGB[:5, :7], RGB[:5, :7]),
        (RGB.tolist(), RGB),
        (Image.fromarray(RGB), RGB),
        (RGB.astype(np.int64), RGB),
        (RGB.astype(np.uint16), RGB),
        (RGB.astype(np.uint16) * 257, RGB),
        (RGB.astype(np.float64), RGB),
        (RGB.astype(np.float32) / 255, RGB),
        ((RGB / 255).astype(np.float16), RGB),
        (RGB / 255 * (1 + 1e-6) - 1e-6, RGB),
        (RGB > 127, np.where(RGB > 127, 255, 0)),
        (OPAQUE, RGB),
        (OPAQUE / 255, RGB),
        (GREY[..., 0], AS_GREY),
        (GREY, AS_GREY),
        (GREY[..., 0] / 255, AS_GREY),
        (np.moveaxis(RGB, -1, 0), RGB),
        (np.moveaxis(GREY, -1, 0), AS_GREY),
        (np.moveaxis(OPAQUE, -1, 0), RGB),
        ([RGB * 0, RGB], RGB),
        ((RGB * 0, RGB), RGB),
        (np.stack([RGB * 0, RGB]), RGB),
    ],
)
def test_what_is_a_picture_is_that_picture(drawn, seen):
    np.testing.assert_array_equal(filmed(drawn)[0], seen)


def test_what_is_not_opaque_lies_over_white():
    half = np.array([[[200, 0, 100, 0], [200, 0, 100, 51], [200, 0, 100, 255]]], np.uint8)
    np.testing.assert_array_equal(
        filmed(half)[0], [[[255, 255, 255], [244, 204, 224], [200, 0, 100]]]
    )


def test_a_film_has_one_white():
    """Black says nothing of it; a dark frame is as dark as it was meant."""
    dark, bright = np.full((2, 2, 3), 1.0), np.full((2, 2, 3), 200.0)
    frames = filmed(dark * 0, bright, dark)
    assert [int(frame.max()) for frame in frames] == [0, 200, 1]
    deep = np.full((2, 2), 40_000, np.uint16)
    frames = filmed(deep, deep // 200)
    assert [int(frame.max()) for frame in frames] == [156, 1]
    with pytest.raises(ValueError, match=r"^Frame 1 of Mine-v0 has numbers from 200 to 200, th"):
        filmed(dark, bright)


def test_a_frame_is_no_view_of_the_world_s_own_memory():
    canvas = RGB.copy()
    film = Film("Mine-v0", 20)
    film.add(canvas)
    canvas[:] = 0
    np.testing.assert_array_equal(film.frames[0], RGB)


@pytest.mark.parametrize(
    ("drawn", "what"),
    [
        ("┌──┐\n└──┘", "is a str"),
        (b"bytes", "is a bytes"),
        ({"rgb": RGB}, "is a dict"),
        (object(), "is a object"),
        ([RGB[0].tolist(), [1]], "is a list"),
        (RGB.astype(complex), "is a ndarray"),
        (7, "has shape ()"),
        (RGB[0, 0], "has shape (3,)"),
        (RGB[..., :2], "has shape (6, 8, 2)"),
        (np.zeros((2, 5, 5)), "has shape (2, 5, 5)"),
        (np.zeros((0, 5, 3), np.uint8), "has shape (0, 5, 3)"),
        (np.zeros((1, 1, 1, 1, 3), np.uint8), "has shape (1, 1, 1, 1, 3)"),
        (np.full((2, 2, 3), np.nan), "has numbers that are not finite"),
        (np.full((2, 2, 3), np.inf), "has numbers that are not finite"),
        (RGB / 127.5 - 1, "has numbers from -1 to 1"),
        (RGB / 200, "has numbers from 0 to 1.275"),
        (RGB.astype(float) * 2, "has numbers from 0 to 510"),
        (RGB.astype(int) * 257, "has numbers from 0 to 65535"),
    ],
)
def test_what_is_none_is_one_sentence(drawn, what):
    with pytest.raises(ValueError) as refused:  # noqa: PT011  (its whole sentence is compared)
        filmed(RGB, drawn)
    assert str(refused.value) == f"Frame 1 of Mine-v0 {what}: {FITTING}"


@pytest.mark.parametrize("nothing", [None, [], ()])
def test_nothing_is_said_to_be_nothing(nothing):
    words = r"^Mine-v0 draws no picture: nothing can be filmed\.$"
    with pytest.raises(ValueError, match=words):
        filmed(nothing)
    with pytest.raises(ValueError, match=r"^Frame 1 of Mine-v0 is a NoneType: let render\(\) "):
        filmed(RGB, nothing)


@pytest.mark.parametrize(
    ("told", "rate"),
    [
        (50, 50),
        (np.float32(12.5), 12.5),
        (np.int64(4), 4),
        (1e9, FASTEST),
        (1e-9, SLOWEST),
        *((nothing, 20) for nothing in (0, -5, None, "30", True, float("nan"), float("inf"), [30])),
    ],
)
def test_the_pace_is_the_world_s_if_it_has_one(told, rate):
    assert frame_rate({"render_fps": told}) == rate


def test_worlds_know_their_pace():
    class Quick(Point):
        metadata = {"render_fps": 50}  # noqa: RUF012  (as Gymnasium declares it)

    assert frame_rate({}) == frame_rate(None) == open_worlds(Point).frame_rate == 20
    assert open_worlds(Quick, time_limit=5).frame_rate == 50
