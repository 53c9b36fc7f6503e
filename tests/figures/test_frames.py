"""Pictures of the tasks: what moves in the world moves in the picture, to the right place."""

import numpy as np
import pytest

from detpg.environments import LQR, MountainCar, Pendulum, PuddleWorld, ScaledActions
from detpg.figures.frames import FRAMES, render


def centre(picture, red):
    """Mean place of the body's pixels in the picture, from the lower left corner, in [0, 1]."""
    r, g, b = np.moveaxis(picture.astype(int), 2, 0)
    body = (r > 180) & (g < 80) & (b < 80) if red else (b > 150) & (r < 60) & (g < 150)
    rows, columns = np.nonzero(body)
    return columns.mean() / len(picture), 1 - rows.mean() / len(picture)


@pytest.mark.parametrize("world", [MountainCar(), Pendulum(), PuddleWorld()])
def test_pixels(world):
    picture = render(world, world.spec.observation_low, pixels=96)
    assert picture.shape == (96, 96, 3)
    assert picture.dtype == np.uint8
    assert world.spec.name in FRAMES
    np.testing.assert_array_equal(
        picture, render(ScaledActions(world), (world.spec.observation_low), pixels=96)
    )


@pytest.mark.parametrize(
    ("world", "state", "place", "red"),
    [
        (PuddleWorld(), (0.2, 0.4), (0.2, 0.4), True),
        (Pendulum(), (np.pi / 2, 0.0), (0.5 + 1 / 2.5, 0.5), False),
        (Pendulum(), (np.pi, 0.0), (0.5, 0.5 - 1 / 2.5), False),
        (MountainCar(), (-0.5, 0.0), (0.75 / 1.9, (1.28 + np.sin(-1.5)) / 2.6), False),
    ],
)
def test_the_body_is_where_the_state_says(world, state, place, red):
    np.testing.assert_allclose(centre(render(world, state), red), place, rtol=0, atol=0.01)


def test_what_has_no_picture_is_refused():
    with pytest.raises(
        ValueError, match=r"^'lqr' has no picture: choose one of mountain-car, .*\.$"
    ):
        render(LQR(), np.zeros(2))
