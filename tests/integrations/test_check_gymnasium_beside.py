"""What `check_gymnasium` finds of state that training and judging do not share, or share."""

import gymnasium
import numpy as np
import pytest
from gymnasium import wrappers
from points import LENGTH, Point, bad, checked, of

from detpg.testing import check_gymnasium
from detpg.world_error import WorldError


class Remembering(Point):
    """What is changed by a step is not put back by a reset."""

    wear = 0.0

    def step(self, action):
        self.wear += 1e-3
        seen, reward, *rest = super().step(action)
        return seen, reward - self.wear, *rest


class Widest(gymnasium.ObservationWrapper):
    """Divides by the largest observation so far: no mean, no deviation."""

    largest = 0.01

    def observation(self, observation):
        self.largest = max(self.largest, float(np.abs(observation).max()))
        return (observation / self.largest).astype(np.float32)


class Harder(gymnasium.Wrapper):
    """Asks for more, episode after episode."""

    def __init__(self, env):
        super().__init__(env)
        self.episodes = 0

    def reset(self, **given):
        self.episodes += 1
        return super().reset(**given)

    def step(self, action):
        seen, reward, *rest = super().step(action)
        return seen, reward - 0.01 * self.episodes, *rest


@pytest.mark.parametrize(
    ("make", "keeper"),
    [
        (Remembering, "Remembering"),
        (lambda: wrappers.ClipAction(Widest(Point())), "Widest"),
        (lambda: Harder(wrappers.RecordEpisodeStatistics(Point())), "Harder"),
    ],
)
def test_what_is_kept_over_resets_is_found_in_its_layer(make, keeper):
    findings = checked(make, steps=100)
    assert bad(findings)["same seed"] == "problem"
    assert of(findings, "same seed").found.endswith(
        f", but not in worlds built anew: {keeper} keeps something over its resets."
    )
    assert of(findings, "same seed").advice.startswith("Let reset put back all that a step changes")


class Own(gymnasium.ObservationWrapper):
    """A normaliser of somebody's own."""

    def __init__(self, env, learning=True):
        super().__init__(env)
        self._mean, self._m2, self._n, self.learning = np.zeros(2), np.ones(2), 1, learning

    def observation(self, observation):
        if self.learning:
            self._n += 1
            off = observation - self._mean
            self._mean = self._mean + off / self._n
            self._m2 = self._m2 + off * (observation - self._mean)
        spread = np.sqrt(self._m2 / self._n) + 1e-4
        return np.clip((observation - self._mean) / spread, -10, 10).astype(np.float32)


def fixed():
    """Gymnasium's, with statistics that stay."""
    world = wrappers.NormalizeObservation(Point())
    world.update_running_mean = False
    return world


NORMALISERS = [
    (lambda: wrappers.NormalizeObservation(Point()), "NormalizeObservation", "observations"),
    (lambda: wrappers.ClipAction(wrappers.NormalizeReward(Point())), "NormalizeReward", "rewards"),
    (lambda: wrappers.TimeLimit(Own(Point()), LENGTH), "Own", "both"),
]


@pytest.mark.parametrize(("make", "layer", "kind"), NORMALISERS)
def test_running_statistics_are_found(make, layer, kind):
    findings = checked(make, steps=40)
    assert bad(findings)["running statistics"] == "problem"
    found = of(findings, "running statistics")
    assert found.found.startswith(f"The world's {layer} keeps running statistics (")
    assert f"--normalise {kind} (in Python normalise='{kind}')." in found.advice


@pytest.mark.parametrize(
    "make",
    [
        fixed,
        lambda: Own(Point(), learning=False),
        lambda: wrappers.RecordEpisodeStatistics(
            wrappers.TimeAwareObservation(wrappers.TimeLimit(Point(), LENGTH))
        ),
        lambda: wrappers.FlattenObservation(wrappers.FrameStackObservation(Point(), 2)),
        lambda: wrappers.RescaleAction(Point(), np.float32(-2), np.float32(2)),
    ],
)
def test_wrappers_without_memory_pass(make):
    levels = bad(checked(make, steps=40))
    assert "problem" not in levels.values()
    assert "running statistics" not in levels


class Handle(Point):
    """Worlds that drive one simulator."""

    pulses = 0

    def step(self, action):
        Handle.pulses += 1
        seen, reward, *rest = super().step(action)
        return seen, reward + 0.5 * (Handle.pulses % 2), *rest

    def reset(self, *, seed=None, options=None):
        Handle.pulses = 0
        return super().reset(seed=seed)


def once():
    """What builds a world a single time, and then raises."""
    left = [Point()]

    def make():
        if not left:
            raise OSError("the port is busy")
        return left.pop()

    return make


def test_a_second_world():
    world = Point()
    findings = checked(lambda: wrappers.RecordEpisodeStatistics(world))
    assert bad(findings) == {"second world": "warning"}
    assert of(findings, "second world").found == "What builds it gave the same Point twice."
    assert "--judge-in-same-world" in of(findings, "second world").advice
    findings = checked(once())
    assert bad(findings) == {"second world": "warning"}
    found = of(findings, "second world").found
    assert found.startswith("None can be opened beside the first: ")
    assert "the port is busy" in found
    findings = checked(Handle)
    assert bad(findings) == {"second world": "problem"}
    assert of(findings, "second world").found == (
        "The first one did something else at step 2, when another was stepped beside it."
    )


class Made(Point):
    """A world with an argument."""

    def __init__(self, unit):
        self.unit = unit

    def reward(self):
        return self.unit * super().reward()


def test_options_reach_the_world():
    assert bad(checked(Made, options={"unit": 1.0})) == {}
    assert bad(checked(Made, options={"unit": 1000.0})) == {"reward scale": "warning"}
    with pytest.raises(WorldError, match=r"^environment 'Made' cannot be built: .*'unit'\.$"):
        check_gymnasium(Made)
    with pytest.raises(ValueError, match=r"is built already and takes no unit: give its id, or "):
        check_gymnasium(Point(), options={"unit": 1.0})
