"""Observations and actions of any space, as worlds hand them on."""

import numpy as np
import pytest
from counting import Counting, Spaced, opened
from gymnasium import spaces
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from detpg.integrations.gymnasium.worlds import open_worlds
from detpg.world_error import WorldError

ONE = Box(-1.0, 1.0, (1,))
MODES = [None, *AutoresetMode]


NESTED = spaces.Dict(
    {
        "arm": spaces.Tuple((Box(0, 255, (2, 2), np.uint8), spaces.Discrete(3, start=-1))),
        "hand": spaces.Dict({"touch": spaces.MultiBinary(2), "force": Box(-1.0, np.inf, ())}),
    }
)
SEEN = {
    "arm": (np.array([[1, 2], [3, 255]], np.uint8), 1),
    "hand": {"touch": np.array([1, 0], np.int8), "force": np.float32(0.5)},
}
FLAT = [1, 2, 3, 255, 0, 0, 1, 0.5, 1, 0]  # keys in order of the alphabet


class Nested(Counting):
    """`Counting`, seen through nested spaces; the step stands in one of their components."""

    observation_space = NESTED

    def seen(self):
        hand = {**SEEN["hand"], "force": np.asarray(self.steps, np.float32)}
        return {"arm": SEEN["arm"], "hand": hand}


@pytest.mark.parametrize("mode", MODES)
def test_nested_observations_are_flattened(mode):
    worlds = opened(mode, 2, Nested)
    assert worlds.spec.observation_size == 10
    assert worlds.spec.observation_low == (0,) * 7 + (-1, 0, 0)
    assert worlds.spec.observation_high == (255,) * 4 + (1,) * 3 + (np.inf, 1, 1)
    observation = worlds.reset([0, 0])
    assert observation.dtype == np.float32
    np.testing.assert_array_equal(observation, [[*FLAT[:7], 0, *FLAT[8:]]] * 2)
    steps = [worlds.step(np.zeros((2, 1))) for _ in range(3)]
    assert [step.next_observation[1, 7] for step in steps] == [1, 2, 3]


@pytest.mark.parametrize(
    ("space", "seen", "flat", "low"),
    [
        (Box(0.0, 1.0, ()), 0.5, [0.5], (0.0,)),
        (Box(-2, 2, (2, 2), np.int64), [[1, 2], [-1, 0]], [1, 2, -1, 0], (-2.0,) * 4),
        (Box(-np.inf, np.inf, (2,), np.float64), [0.1, 1e9], [0.1, 1e9], ()),
        (spaces.Discrete(3), np.int64(2), [0, 0, 1], (0.0,) * 3),
        (spaces.MultiDiscrete([2, 2]), np.array([1, 0]), [0, 1, 1, 0], (0.0,) * 4),
        (Box(0, 1, (2,), bool), np.array([True, False]), [1, 0], (0.0,) * 2),
    ],
)
@pytest.mark.parametrize("batched", [False, True])
def test_observations_of_any_kind(space, seen, flat, low, batched):
    seen = np.asarray(seen, space.dtype) if isinstance(space, Box) else seen

    def make():
        return Spaced(space, ONE, seen)

    worlds = open_worlds(SyncVectorEnv([make]) if batched else make)
    assert worlds.spec.observation_low == low
    expected = np.asarray([flat], np.float32)
    np.testing.assert_array_equal(worlds.reset([0]), expected)
    np.testing.assert_array_equal(worlds.step([[0.0]]).next_observation, expected)


@pytest.mark.parametrize(
    "box",
    [
        Box(np.array([0.1, -7.0]), np.array([0.3, 1e-3]), dtype=np.float64),
        Box(-2.0, 2.0, (2, 3)),
        Box(-2.0, 2.0, ()),
        Box(-0.1, 0.1, (2,), np.float16),
        Box(np.array([-np.inf, 0.1, -np.inf]), np.array([0.7, np.inf, np.inf]), dtype=np.float64),
    ],
)
@pytest.mark.parametrize("batched", [False, True])
def test_an_action_arrives_in_the_space(box, batched):
    made = []

    def make():
        made.append(Spaced(ONE, box))
        return made[-1]

    worlds = open_worlds(SyncVectorEnv([make] * 2) if batched else make, 1 if batched else 2)
    worlds.reset([0, 1])
    low, high = (np.asarray(bound) for bound in worlds.spec.bounds)
    ends = [np.where(np.isfinite(x), x, other) for x, other in ((low, -1e6), (high, 1e6))]
    m = worlds.spec.action_size
    assert m == int(np.prod(box.shape))
    for end in (*ends, 0.5 * (ends[0] + ends[1])):
        # As a learner gives it: rounded to float32, and so perhaps past a bound in float64.
        actions = np.stack([end, np.minimum(np.maximum(0.0, low), high)]).astype(np.float32)
        worlds.step(actions)
        for world, action in zip(made[-2:], actions):
            given = world.given[-1]
            assert isinstance(given, np.ndarray) or (batched and box.shape == ())
            assert (given.dtype, given.shape) == (box.dtype, box.shape)
            assert np.asarray(given) in box
            np.testing.assert_allclose(given.ravel(), action, rtol=1e-3 if m == 2 else 1e-6)
            given += 1  # a world may write into what it was given
        np.testing.assert_allclose(actions[0], end, rtol=1e-3)


@pytest.mark.parametrize(
    ("actions", "words"),
    [
        ([[np.nan]], r"^Actions have 1 NaN, the first at \[0, 0\]: .*diverged; give finite numb"),
        ([[2.1]], r"^Action 2\.1 of component 0 lies outside \[-2, 2\]: cap actions to the box"),
        ([[-np.inf]], r"^Action -inf of component 0 lies outside"),
        ([0.0], r"^Actions have shape \(1,\): give them as \(1, 1\)\.$"),
        ([[0.0, 0.0]], r"^Actions have shape \(1, 2\)"),
    ],
)
def test_actions_that_cannot_be_taken_are_refused(actions, words):
    worlds = open_worlds("Pendulum-v1")
    worlds.reset([0])
    with pytest.raises(ValueError, match=words):
        worlds.step(actions)


def test_without_bounds_an_action_is_finite():
    world = Spaced(ONE, Box(-np.inf, np.inf, (1,)))
    worlds = open_worlds(world)
    assert worlds.spec.action_low == (-np.inf,)
    worlds.reset([0])
    worlds.step(np.array([[3e30]], np.float32))
    assert world.given[0] == np.float32(3e30)
    for bad in (np.inf, np.nan):
        with pytest.raises(ValueError, match=r"^Action"):
            worlds.step([[bad]])


@pytest.mark.parametrize(
    ("observation", "action", "words"),
    [
        (ONE, spaces.Discrete(2), r"^The action space Discrete\(2\) cannot be used, Discrete act"),
        (ONE, spaces.Dict(a=ONE), r"Dict actions have no gradient: give a Box of floats, such as"),
        (ONE, Box(0, 9, (1,), np.int32), r"int32 is no float dtype: give a Box of floats"),
        (ONE, Box(-1.0, 1.0, (0,)), r"^The action space .* it has no component: give a Box"),
        (
            ONE,
            Box(np.float32([0, 0]), np.float32([1, 0])),
            r"low = high in component 1: leave it out",
        ),
        (spaces.Text(3), ONE, r"^The observation space Text.* Text is no vector of fixed length"),
        (spaces.Dict(a=spaces.Tuple((spaces.Text(3),))), ONE, r"Text is no vector"),
        (spaces.Sequence(ONE), ONE, r"Sequence is no vector of fixed length: give a Box"),
        (spaces.Graph(ONE, None), ONE, r"Graph is no vector"),
        (Box(0.0, 1.0, (3, 0)), ONE, r"it has no component: give a constant 1 as observation\.$"),
    ],
)
def test_spaces_that_cannot_be_used_are_refused(observation, action, words):
    with pytest.raises(ValueError, match=words):
        open_worlds(Spaced(observation, action))


def test_an_observation_of_another_shape_is_not_stretched():
    world = Spaced(Box(-1.0, 1.0, (3,)), ONE, np.zeros(1, np.float32))
    with pytest.raises(WorldError, match=r"an array of shape \(1,\) and dtype float32 instead of"):
        open_worlds(world).reset([0])
