"""Pictures of the octopus arm: what the state and the action say is seen, and where."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.figure import Figure

from detpg.environments import OctopusArm
from detpg.figures import octopus
from detpg.figures.frames import render

PIXELS = 300
WORLD = OctopusArm(3, target=(1.5, 1.5))
STATE = WORLD.initial(jax.random.key(0))
REST = np.zeros(11)


def colour_at(picture, x, y):
    """The pixel at a point of the plane."""
    axes = Figure().add_subplot()
    octopus.paint(axes, WORLD, STATE)
    column, row = (
        (value - low) / (high - low) * PIXELS
        for value, (low, high) in ((x, axes.get_xlim()), (y, axes.get_ylim()))
    )
    return picture[PIXELS - 1 - int(row), int(column)].astype(int)


def framed(state=STATE, action=None, path=()):
    return octopus.frame(WORLD, state, action, path, pixels=PIXELS)


def test_a_frame_is_pixels_and_the_same_again():
    picture = framed(action=REST)
    assert picture.shape == (PIXELS, PIXELS, 3)
    assert picture.dtype == np.uint8
    np.testing.assert_array_equal(picture, framed())


def test_render_knows_the_arm():
    picture = render(WORLD, STATE, PIXELS)
    np.testing.assert_array_equal(picture, framed())


@pytest.mark.parametrize("muscle", ["dorsal", "transversal", "ventral"])
def test_an_active_muscle_is_red_and_the_others_are_not(muscle):
    x, y = np.asarray(STATE.arm.x), np.asarray(STATE.arm.y)
    middles = {
        "dorsal": (x[0, :2].mean(), y[0, :2].mean()),
        "transversal": (x[:, 1].mean(), y[:, 1].mean()),
        "ventral": (x[1, :2].mean(), y[1, :2].mean()),
    }
    action = REST.copy()
    action[2 + list(middles).index(muscle) :: 3] = 1
    picture, still = framed(action=action), framed()
    for name, place in middles.items():
        red, green, _ = colour_at(picture, *place)
        assert (red - green > 100) == (name == muscle)
        np.testing.assert_array_less(np.ptp(colour_at(still, *place)), 100)


def test_the_target_is_where_it_is_and_turns_green_when_hit():
    red, _, blue = colour_at(framed(), 1.5, 1.5)
    assert red > 200
    assert blue < 60
    inside = dataclasses.replace(STATE, target=jnp.asarray([1.5, 0.0]))
    red, green, _ = colour_at(framed(inside), 1.5, 0.0)
    assert green > red + 50


def test_the_path_and_the_torque_are_seen():
    path = [(-2.0, -2.0), (0.0, -2.0), (2.0, -2.0)]
    assert (
        np.abs(colour_at(framed(path=path), 1.0, -2.0) - colour_at(framed(), 1.0, -2.0)).max() > 50
    )
    turning = REST.copy()
    turning[0] = 1
    other = turning[[1, 0, *range(2, 11)]]
    still, left, right = framed(), framed(action=turning), framed(action=other)
    for one, two in ((still, left), (still, right), (left, right)):
        assert np.any(one != two)


def test_water_is_seen_up_to_its_surface():
    parameters = dataclasses.replace(WORLD.parameters, surface_level=2.0)
    world = OctopusArm(parameters=parameters, target=(1.5, 1.5))
    picture = octopus.frame(world, STATE, pixels=PIXELS)
    assert colour_at(picture, -2.0, 2.2).tolist() == [255, 255, 255]
    red, _, blue = colour_at(picture, -2.0, 1.8)
    assert red < blue


def test_a_figure_has_axes_and_a_scale():
    axes, bar = octopus.figure(WORLD, STATE, REST).axes
    assert (axes.get_xlabel(), bar.get_ylabel()) == ("x", "activation")


def film():
    states = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf + 0.1]), STATE)
    return octopus.frames(WORLD, states, np.stack([REST, REST]), pixels=64)


def test_each_state_of_a_film_has_its_picture():
    pictures = list(film())
    assert [picture.shape for picture in pictures] == [(64, 64, 3)] * 2
    assert np.any(pictures[0] != pictures[1])
