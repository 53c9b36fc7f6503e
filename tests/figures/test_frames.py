"""Pictures of the tasks: what moves in the world moves in the picture, to the right place."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.environments import LQR, MountainCar, OctopusArm, Pendulum, PuddleWorld, ScaledActions
from detpg.figures.frames import FRAMES, film, render


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


def test_a_scaled_action_is_drawn_as_the_activation_that_it_is():
    """-1 is no activation and 1 is full; a picture by itself and one of a film."""
    arm = OctopusArm(2)
    state = arm.initial(jax.random.key(0))
    states = jax.tree.map(lambda leaf: leaf[None], state)
    for scaled, legal in ((-1.0, 0.0), (0.5, 0.75)):
        scaled, legal = (jnp.full(8, x, dtype=float) for x in (scaled, legal))
        expected = render(arm, state, 96, legal)
        np.testing.assert_array_equal(render(ScaledActions(arm), state, 96, scaled), expected)
        (expected,) = film(arm, states, legal[None], 96)
        (found,) = film(ScaledActions(arm), states, scaled[None], 96)
        np.testing.assert_array_equal(found, expected)
    assert not np.array_equal(expected, next(film(arm, states, 0 * legal[None], 96)))


def test_what_has_no_picture_is_refused():
    with pytest.raises(
        ValueError, match=r"^'lqr' has no picture: choose one of mountain-car, .*\.$"
    ):
        render(LQR(), np.zeros(2))
