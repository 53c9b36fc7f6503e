"""Each finding of `check_gymnasium` against a world with that fault, and a world without any."""

import numpy as np
import pytest
from gymnasium.spaces import Box, Dict, Discrete
from gymnasium.wrappers import TimeLimit
from points import LENGTH, Falling, Point, bad, checked, of

from detpg.testing.findings import problem
from detpg.testing.judgements import judge_observation_scale
from detpg.testing.played import Play


def test_a_world_without_fault_is_fine():
    findings = checked(Point)
    assert bad(findings) == {}
    assert [finding.level for finding in findings] == ["fine"] * 11
    assert len({finding.check for finding in findings}) == 11
    assert not any(finding.advice for finding in findings)
    assert of(findings, "episodes").found == (
        "Episodes that ended: 20, of length 20; the time limit is 20."
    )


def test_an_environment_that_is_given_is_left_open():
    closed = []

    class Closing(Point):
        def close(self):
            closed.append(self)

    world = TimeLimit(Closing(), LENGTH)
    assert bad(checked(world, None)) == {}
    assert bad(checked(Closing(), LENGTH)) == {}
    assert closed == []
    checked(Closing)
    assert len(set(map(id, closed))) == len(closed) == 2  # one, and one beside it


class Unseeded(Point):
    def step(self, action):
        seen, reward, *rest = super().step(action)
        return seen, reward + 1e-12 * np.random.default_rng().normal(), *rest


class UnseededReset(Point):
    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place = np.random.default_rng().uniform(-1, 1, 2).astype(np.float32)
        return self.place.copy(), {}


@pytest.mark.parametrize(
    ("make", "where"), [(Unseeded, "at step 1"), (UnseededReset, "at the reset")]
)
def test_the_same_seed_gives_something_else(make, where):
    findings = checked(make)
    assert bad(findings) == {"same seed": "problem"}
    found = of(findings, "same seed")
    assert found.found == f"The same seed and the same actions gave something else {where}."
    assert "self.np_random" in found.advice
    assert all(finding.check != "action" for finding in findings)  # nothing can be said of it


@pytest.mark.parametrize(
    ("members", "found"),
    [
        ({"of_reward": True, "value": np.nan}, "The reward of step 3 was nan."),
        ({"of_reward": True, "value": -np.inf}, "The reward of step 3 was -inf."),
        ({"of_reward": False, "value": np.nan}, "Component 1 of an observation was nan."),
    ],
)
def test_numbers_that_are_not_finite(members, found):
    class Broken(Point):
        def step(self, action):
            seen, reward, *rest = super().step(action)
            if self.steps == 3 and members["of_reward"]:
                reward = members["value"]
            if self.steps == 3 and not members["of_reward"]:
                seen[1] = members["value"]
            return seen, reward, *rest

    findings = checked(Broken)
    assert bad(findings) == {"finite numbers": "problem"}
    assert of(findings, "finite numbers").found == found


class Outside(Point):
    observation_space = Box(-0.5, 10.0, (2,))


class Double(Point):
    def step(self, action):
        seen, *rest = super().step(action)
        return seen.astype(np.float64), *rest


class Unlisted(Point):
    """A Discrete part with a value that is none of its values."""

    observation_space = Dict(place=Box(-10.0, 10.0, (2,)), which=Discrete(2, start=1))

    def reset(self, *, seed=None, options=None):
        seen, info = super().reset(seed=seed)
        return {"place": seen, "which": np.int64(1)}, info

    def step(self, action):
        seen, *rest = super().step(action)
        return {"place": seen, "which": np.int64(0 if self.steps == 7 else 1)}, *rest


def test_observations_outside_their_space():
    findings = checked(Outside)
    assert bad(findings) == {"observation space": "problem"}
    found = of(findings, "observation space").found
    assert found.startswith("In an observation, component ")
    assert found.endswith("outside [-0.5, 10].")
    findings = checked(Double)
    assert bad(findings) == {"observation space": "warning"}
    assert of(findings, "observation space").found == (
        "In an observation, the dtype is float64, not float32."
    )
    findings = checked(Unlisted)
    assert of(findings, "steps").found == (
        "Step 7 returned what cannot be used, the observation['which'] was 0 (int) instead of a "
        "whole number from 1 to 2: let the world return that, or correct its observation_space."
    )


class Scaled(Point):
    observation_space = Box(-np.inf, np.inf, (3,))
    units, reward_unit = np.array([100.0, 1.0, 0.001]), 1.0

    def reset(self, *, seed=None, options=None):
        seen, info = super().reset(seed=seed)
        return self.scaled(seen), info

    def step(self, action):
        seen, reward, *rest = super().step(action)
        return self.scaled(seen), self.reward_unit * reward, *rest

    def scaled(self, seen):
        return (np.append(seen, seen[0]) * self.units).astype(np.float32)


class Costly(Point):
    def reward(self):
        return 100 * super().reward()


class Cheap(Point):
    def reward(self):
        return 1e-4 * super().reward()


class Still(Scaled):
    units = np.array([1.0, 1.0, 0.0])


def test_scales_that_need_a_normaliser():
    findings = checked(Scaled)
    assert bad(findings) == {"observation scale": "warning"}
    found = of(findings, "observation scale").found
    assert found.startswith("Far from a size of 1 (root mean square): component 0 (")
    assert ", 2 (0.0" in found
    assert ", 1 (" not in found
    for make in (Costly, Cheap):
        findings = checked(make)
        assert bad(findings) == {"reward scale": "warning"}
        assert "--normalise both" in of(findings, "reward scale").advice
    findings = checked(Still)
    assert bad(findings) == {"observation scale": "warning"}
    assert of(findings, "observation scale").found == "It never changed in 400 steps: component 2."


@pytest.mark.parametrize(
    ("offset", "step", "told"),
    [
        (1.7e9, 1.0, True),
        (1e6, 0.01, True),
        (-1e-6, 1e-14, True),
        (1.7e9, 1000.0, False),
        (0.0, 1e-12, False),
        (273.15, 0.1, False),
    ],
)
@pytest.mark.parametrize("dtype", [np.float64, np.float32])  # of what the world hands out
def test_an_offset_in_which_single_precision_loses_the_signal(offset, step, told, dtype):
    told_of = [np.asarray([np.sin(t), offset + step * t], dtype) for t in range(400)]
    seen = [observation.astype(np.float64) for observation in told_of]
    found = judge_observation_scale(Play(observations=seen, rewards=[0.0] * 399))
    assert [each.level for each in found if each.level == "problem"] == ["problem"] * told
    if offset == 1.7e9 and told:
        assert found == [
            problem(
                "observation scale",
                "Component 1 of the observation lies near 1.7e+09, where single precision knows "
                "steps of 1.3e+02 alone: most of its changes are lost.",
                "Subtract the offset in the world, as the time of the reset from a clock: learners "
                "compute in single precision, and no normaliser brings back what it lost.",
            )
        ]


def test_what_settles_down_loses_nothing():
    seen = [np.asarray([1 + 0.5**t]) for t in range(400)]
    found = judge_observation_scale(Play(observations=seen, rewards=[0.0] * 399))
    assert [each.level for each in found] == ["fine"]


class Unbounded(Point):
    action_space = Box(np.float32([-1.0]), np.float32([np.inf]))

    def step(self, action):
        return super().step(np.tanh(action))


class Wide(Point):
    action_space = Box(-1e8, 1e8, (1,))

    def step(self, action):
        return super().step(action / 1e8)


def test_actions_without_scale():
    findings = checked(Unbounded)
    assert bad(findings) == {"action bounds": "warning"}
    assert of(findings, "action bounds").found.startswith("Component 0 of the action has no bound")
    findings = checked(Wide)
    assert bad(findings) == {"action bounds": "warning"}
    assert of(findings, "action bounds").found.endswith("ranges from -1e+08 to 1e+08.")


class Endless(Point):
    """Bounds that are the largest numbers there are."""

    action_space = Box(-np.finfo(np.float32).max, np.finfo(np.float32).max, (1,))

    def step(self, action):
        assert abs(action[0]) < 10
        return super().step(np.tanh(action))


class Roomy(Point):
    observation_space = Box(-1e4, 1e4, Point.observation_space.shape)


def test_bounds_that_cannot_be_meant_are_none():
    findings = checked(Endless)
    assert bad(findings) == {"action bounds": "warning"}
    assert "(those of 1e+15 or more count as none)" in of(findings, "action bounds").advice


def test_bounds_that_tiles_cannot_use_are_told():
    findings = checked(Roomy)
    assert bad(findings) == {"observation bounds": "warning"}
    assert of(findings, "observation bounds").found.endswith("but its bounds are -10000 and 10000.")


class Clocked(Point):
    """Calls its own time limit a true end."""

    def step(self, action):
        seen, reward, *_ = super().step(action)
        return seen, reward, self.steps == LENGTH, False, {}


class Cut(Point):
    """Keeps its own time limit, and calls it so."""

    def step(self, action):
        seen, reward, *_ = super().step(action)
        return seen, reward, False, self.steps == LENGTH, {}


def test_ends_and_time_limits():
    findings = checked(Point, None)
    assert bad(findings) == {"episodes": "warning"}
    assert of(findings, "episodes").found == (
        "No episode ended in 400 steps, and no time limit is known."
    )
    assert "--time-limit" in of(findings, "episodes").advice
    findings = checked(Falling, None)
    assert bad(findings) == {"episodes": "warning"}
    assert of(findings, "episodes").found.endswith("no time limit is known.")
    for make, limit in ((Falling, 1000), (Cut, None), (Point, 1000)):
        assert bad(checked(make, limit)) == {}


def test_a_time_limit_that_is_called_a_true_end():
    findings = checked(Clocked, LENGTH)
    assert bad(findings) == {"episodes": "problem"}
    assert of(findings, "episodes").found == (
        "Episodes that ended: 20, of length 20, the time limit, and all with terminated=True."
    )
    assert "truncated=True" in of(findings, "episodes").advice
    findings = checked(Clocked, None)
    assert bad(findings) == {"episodes": "warning"}
    assert "whatever was done" in of(findings, "episodes").found


class Camera(Point):
    """A picture, most of it black, and what moves in it."""

    observation_space = Box(0, 255, (64, 64, 3), np.uint8)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self.seen(), {}

    def step(self, action):
        _, *rest = super().step(action)
        return self.seen(), *rest

    def seen(self):
        picture = np.zeros((64, 64, 3), np.uint8)
        picture[:8] = np.clip(np.abs(self.place).max() * 25, 0, 255)
        return picture


class CameraBeside(Camera):
    observation_space = Dict(
        camera=Box(0, 255, (64, 64, 3), np.uint8), speed=Box(-10.0, 10.0, (1,))
    )

    def seen(self):
        return {"camera": super().seen(), "speed": self.place[:1].copy()}


class Long(Point):
    """Many numbers that are none of a camera's."""

    observation_space = Box(-1e4, 1e4, (40, 50))

    def reset(self, *, seed=None, options=None):
        seen, info = super().reset(seed=seed)
        return self.spread(seen), info

    def step(self, action):
        seen, *rest = super().step(action)
        return self.spread(seen), *rest

    def spread(self, seen):
        return np.tile(seen * 1000, 1000).reshape(40, 50)


@pytest.mark.parametrize("make", [Camera, CameraBeside])
def test_a_camera_is_told_in_a_sentence(make):
    findings = checked(make, steps=80)
    assert of(findings, "pixels").found == (
        "The observation holds a picture: uint8 of shape (64, 64, 3), 12288 numbers."
    )
    assert of(findings, "pixels").advice.startswith("Pixels are not what these learners take: ")
    assert of(findings, "pixels").advice.count(". ") == 0
    still, off = (f.found for f in findings if f.check == "observation scale")
    assert still == (
        "It never changed in 80 steps: component 1536, 1537, 1538, 1539, 1540 and 10747 more."
    )
    assert off.startswith("Far from a size of 1 (root mean square): component 0 (")
    assert off.endswith(") and 1531 more.")
    assert sum(len(f.found) + len(f.advice) for f in findings) < 3000


def test_many_components_are_counted():
    findings = checked(Long, steps=80)
    assert [f.check for f in findings if f.check == "pixels"] == []
    found = of(findings, "observation scale").found
    assert found.endswith(") and 1995 more.")


def test_what_another_library_says_at_length_is_cut():
    class Wordy(Point):
        def step(self, action):
            raise ValueError(str(np.arange(900).tolist()))

    for found in checked(Wordy):
        assert len(found.found) <= 400
