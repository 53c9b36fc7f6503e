"""Further findings of `check_gymnasium`: rewards, actions, spaces, worlds that break."""

import numpy as np
import pytest
from counting import Spaced
from gymnasium.spaces import Box, Discrete, Text
from gymnasium.vector import SyncVectorEnv
from points import Falling, Point, bad, checked, of

from detpg.testing import check_gymnasium


class Brief(Point):
    """A bandit: one step, and a true end."""

    def step(self, action):
        seen, reward, *_ = super().step(action)
        return seen, reward, True, False, {}


def test_a_bandit_ends_truly():
    assert bad(checked(Brief, None)) == {"episodes": "warning"}
    assert bad(checked(Brief, 1)) == {}


class Flat(Point):
    def reward(self):
        return -1.0


class Racing(Falling):
    """The sooner it ends, the better: a reward that never changes says enough."""

    def reward(self):
        return -1.0


def test_a_reward_that_never_changes():
    findings = checked(Flat)
    assert bad(findings) == {"reward": "warning"}
    assert of(findings, "reward").found == ("The reward was -1 in all 400 steps of random actions.")
    assert bad(checked(Racing)) == {}


class Deaf(Point):
    def step(self, action):
        return super().step(np.zeros_like(action))


def test_a_step_that_ignores_its_action():
    findings = checked(Deaf)
    assert bad(findings) == {"action": "problem"}
    assert of(findings, "action").found == "Other actions gave the same 100 steps, to the bit."


class Rewriting(Point):
    def reset(self, *, seed=None, options=None):
        seen, info = super().reset(seed=seed)
        self.memory = seen
        return self.memory, info

    def step(self, action):
        seen, *rest = super().step(action)
        self.memory[...] = seen
        return self.memory, *rest


def test_an_observation_that_is_written_over():
    findings = checked(Rewriting)
    assert bad(findings) == {"observations stay": "problem"}
    assert of(findings, "observations stay").found.startswith("Step 1 changed the observation")


@pytest.mark.parametrize(
    ("observation", "action", "found"),
    [
        (Box(-1.0, 1.0, (1,)), Discrete(2), {"action space"}),
        (Text(3), Box(-1.0, 1.0, (1,)), {"observation space"}),
        (Text(3), Box(0, 9, (1,), np.int32), {"action space", "observation space"}),
    ],
)
def test_spaces_that_cannot_be_used(observation, action, found):
    findings = check_gymnasium(Spaced(observation, action))
    assert {finding.check for finding in findings} == found
    for finding in findings:
        assert finding.level == "problem"
        assert "cannot be used" in finding.found
        assert finding.advice.startswith("Give a Box of ")


class Crashing(Point):
    def step(self, action):
        if self.steps == 4:
            raise RuntimeError("the arm\nis stuck")
        return super().step(action)


class Misshapen(Point):
    def step(self, action):
        seen, *rest = super().step(action)
        return seen[:1], *rest


class Closed(Point):
    def reset(self, *, seed=None, options=None):
        raise OSError("no robot")


def test_worlds_that_break():
    found = of(checked(Crashing), "steps")
    assert found.level == "problem"
    assert found.found == "Step 5 raised RuntimeError: the arm is stuck."
    assert of(checked(Misshapen), "steps").found == (
        "Step 1 returned what cannot be used, the observation was an array of shape (1,) and dtype "
        "float32 instead of numbers of shape (2,): let the world return that, or correct its "
        "observation_space."
    )
    assert of(checked(Closed), "steps").found == "The reset raised OSError: no robot."


class Wordless(Point):
    """Says nothing of its seed to Gymnasium."""

    def reset(self, *, seed=None, options=None):
        self.generator = np.random.default_rng(seed)
        self.place, self.steps = self.generator.uniform(-1, 1, 2).astype(np.float32), 0
        return self.place.copy(), {}


class Wording(Point):
    def step(self, action):
        seen, reward, terminated, truncated, info = super().step(action)
        return seen, np.array(reward), terminated, truncated, info


def test_what_gymnasium_says_is_passed_on():
    own = "Gymnasium's own checks"
    found = of(checked(Wordless), own)
    assert found.level == "problem"
    assert "super().reset(seed=seed)" in found.found
    found = of(checked(Wording), own)
    assert found.level == "warning"
    assert found.found.startswith("The reward returned by `step()` must be a float")
    # Actions of any size are in units of their box here: no word of that.
    assert of(check_gymnasium("Pendulum-v1", steps=10), own).level == "fine"


@pytest.mark.parametrize("name", ["Pendulum-v1", "MountainCarContinuous-v0", "detpg/LQR-v0"])
def test_known_environments_have_no_problem(name):
    findings = check_gymnasium(name, steps=410)
    assert not [finding for finding in findings if finding.level == "problem"]


def test_what_cannot_be_checked_is_one_sentence():
    with pytest.raises(ValueError, match=r"^environment 'Pendulm-v1' cannot be built: "):
        check_gymnasium("Pendulm-v1")
    with pytest.raises(ValueError, match=r"^steps = 0 is not usable: give 1 or more\.$"):
        check_gymnasium(Point, steps=0)
    with pytest.raises(ValueError, match=r"^SyncVectorEnv is not one environment: give one of"):
        check_gymnasium(lambda: SyncVectorEnv([Point]))
