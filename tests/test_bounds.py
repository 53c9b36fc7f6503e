"""An end of a box that nobody can mean counts as none, everywhere; odd units stay as they are."""

import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.spaces import Box, Dict

from detpg.bounds import Bounds
from detpg.environments import LQR, ScaledActions
from detpg.features import TileCoding
from detpg.integrations.gymnasium.flat import FlatActions, FlatObservations
from detpg.testing.judgements import judge_bounds
from detpg.types import EnvironmentSpec
from detpg.wrappers.controller import in_world_units

INF = float("inf")
HUGE = [
    float(np.finfo(np.float32).max),
    float(np.finfo(np.float64).max),
    float(np.finfo(np.float16).max),
    1e30,
    1e15,
    float(np.iinfo(np.int64).max),
    2.0**31 - 1,
    INF,
]
SANE = [1e-7, 1e-3, 1.0, 255.0, 32767.0, 65535.0, 1e6, 1e9, 1e12, 1e14]


def spec(low, high, seen_low=(-1.0,), seen_high=(1.0,)):
    return EnvironmentSpec("toy", len(seen_low), len(low), low, high, 10, 0.9, seen_low, seen_high)


@pytest.mark.parametrize("end", HUGE)
def test_what_cannot_be_meant_is_no_bound(end):
    bounds = Bounds((-end, -1.0, -end, -2.0), (end, end, 0.5, 4.0))
    assert bounds.meant == ((-INF, -1.0, -INF, -2.0), (INF, INF, 0.5, 4.0))
    assert bounds.scaled == ((-INF, -1.0, -INF, -1.0), (INF, INF, 0.5, 1.0))
    assert bounds.centre == (0.0, 0.0, 0.0, 1.0)
    assert bounds.half_range == (1.0, 1.0, 1.0, 3.0)
    found = spec(*bounds, (-end, -1.0), (1.0, end))
    assert found.bounds == bounds.meant
    assert (found.observation_low, found.observation_high) == ((-INF, -1.0), (1.0, INF))
    assert "no bound on one side or both" in judge_bounds(found).found


@pytest.mark.parametrize("end", SANE)
def test_odd_units_stay_bounded(end):
    bounds = Bounds((-end,), (end,))
    assert (bounds.meant, bounds.scaled) == (bounds, ((-1.0,), (1.0,)))
    assert bounds.half_range == (end,)
    coder = TileCoding.for_environment(spec(*bounds, *bounds), 4, num_tilings=2)
    ends = [coder.active(jnp.asarray([x * end]))[0] for x in (-0.9, -0.4, 0.4, 0.9)]
    assert list(map(int, ends)) == [0, 1, 2, 3]


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int32, np.int64])
def test_spaces_up_to_the_largest_number_of_their_type_have_no_bounds(dtype):
    most = np.finfo(dtype) if np.dtype(dtype).kind == "f" else np.iinfo(dtype)
    wide = Box(most.min, most.max, (2,), dtype)
    found = FlatObservations(wide)
    assert (found.low, found.high) == ((), ())
    speed = FlatObservations(Dict({"a": Box(-1, 1, (1,)), "b": wide}))
    assert (speed.low, speed.high) == ((-1.0, -INF, -INF), (1.0, INF, INF))


def test_actions_keep_to_the_bound_that_is_one():
    """A huge bound on the other side used to let everything pass for rounding."""
    most = np.finfo(np.float32).max
    actions = FlatActions(Box(np.float32([0.0]), np.float32([most])), 1)
    assert (actions.low, actions.high) == ((0.0,), (INF,))
    assert actions.legal([[5.0]]).tolist() == [[5.0]]
    with pytest.raises(ValueError, match=r"^Action -5 of component 0 lies outside \[0, inf\]"):
        actions.legal([[-5.0]])


def test_a_unit_of_an_action_is_the_worlds_own_where_a_bound_is_absurd():
    bounds = Bounds((-3.4e38,), (3.4e38,))
    assert in_world_units(jnp.asarray([0.5]), bounds).tolist() == [0.5]
    assert ScaledActions(LQR()).spec.bounds == Bounds.unbounded(1)


def test_tiles_over_an_unbounded_observation_are_refused_in_one_sentence():
    with pytest.raises(ValueError) as caught:  # noqa: PT011  (the sentence is read)
        TileCoding.for_environment(spec((-1.0,), (1.0,), (-1.0, -3.4e38), (1.0, 3.4e38)))
    assert str(caught.value) == (
        "Component 1 of the observations of 'toy' ranges from -inf to inf, so that tiles cannot "
        "cover it (bounds of 1e+15 or more count as none): normalise observations, bound them in "
        "the world, or give a TileCoding low and high yourself."
    )
    with pytest.raises(ValueError, match=r"cannot be covered by tiles: give numbers below 1e\+15"):
        TileCoding((-3.4e38,), (3.4e38,), (4,))
