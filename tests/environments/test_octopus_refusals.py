"""What no octopus arm can be built from is said in one sentence."""

import dataclasses
import math

import jax
import numpy as np
import pytest

from detpg.environments import OctopusArm
from detpg.environments.octopus_arm import PARAMETERS


def changed(**changes):
    return dataclasses.replace(PARAMETERS["A"](), **changes)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: OctopusArm(0), "num_segments = 0 is not usable: give 1 to 10 "),
        (lambda: OctopusArm(11), "num_segments = 11 is not usable: give 1 to 10 "),
        (lambda: OctopusArm(2.5), "num_segments = 2.5 is not usable: give 1 to 10 "),
        (lambda: OctopusArm(6, "C"), "parameters 'C' are unknown: choose one of A, B, or give"),
        (
            lambda: changed(mass=[1.0] * 5),
            r"upper \(11, 2\), lower \(11, 2\) and mass \(5,\) do not",
        ),
        (lambda: changed(mass=[1.0] * 10 + [0.0]), "mass holds 0, which no arm can have"),
        (lambda: changed(pressure=math.nan), "pressure holds nan, which no arm can have"),
        (lambda: changed(muscle_damping=-1.0), "muscle_damping holds -1, which no arm can have"),
        (
            lambda: changed(upper=changed().lower, lower=changed().upper),
            "Two neighbouring nodes coincide or a compartment is turned inside out",
        ),
        (
            lambda: OctopusArm(target="moon"),
            "target 'moon' is unknown: choose one of default, near",
        ),
        (lambda: OctopusArm(target=(1.0, math.nan)), "target .* is no point: give two finite"),
        (lambda: OctopusArm(target=(1.0, 2.0, 3.0)), "target .* is no point: give two finite"),
        (lambda: OctopusArm(target=("a", "b")), "target .* is no point: give two finite"),
        (lambda: OctopusArm(target=None), "target None is no point: give two finite"),
        (lambda: OctopusArm(target=(2.0, 0.0)), r"target \(2, 0\) is where the arm starts"),
        (
            lambda: OctopusArm(target=(4.0, 1.0), start_noise=0.3),
            r"target \(4, 1\) is where the arm starts",
        ),
        (lambda: OctopusArm(observation_scale="big"), "observation_scale 'big' is unknown: "),
        (lambda: OctopusArm(observation_scale=[1.0]), r"observation_scale .* give 50 positive"),
        (lambda: OctopusArm(start_noise=-0.1), "start_noise = -0.1 is not usable: "),
        (lambda: OctopusArm(time_limit=0), "time_limit = 0 and discount = 0.99 are not usable"),
        (lambda: OctopusArm(discount=1.5), "time_limit = 300 and discount = 1.5 are not usable"),
        (lambda: OctopusArm(hit_reward=math.inf), "hit_reward = inf is not usable: "),
    ],
)
def test_what_is_wrong_is_said(make, words):
    with pytest.raises(ValueError, match=f"^{words}.*[.]"):
        make()


@pytest.mark.parametrize("angle", np.linspace(-0.5, 0.5, 41))
def test_a_target_on_which_a_turned_arm_may_start(angle):
    """At the tip, the arm is as wide as 0.15 rad; targets lie between any few angles looked at."""
    target = 5.3 * math.cos(angle), 5.3 * math.sin(angle)
    with pytest.raises(ValueError, match=r"is where the arm starts: place it elsewhere[.]$"):
        OctopusArm(target=target, start_noise=math.pi)


def test_a_target_that_no_episode_has_is_not_looked_at():
    """Each episode draws its own; the one that stands there may be anywhere."""
    world = OctopusArm(random_targets=True, target=(60.0, 50.0))
    drawn = world.initial(jax.random.key(0)).target
    assert math.hypot(*np.asarray(drawn)) < 5.4
    assert OctopusArm(random_targets=True, target=(2.0, 0.0)).random_targets
