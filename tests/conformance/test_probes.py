"""Every algorithm learns what is known of the probes, and a broken one does not."""

import dataclasses

import jax
import jax.numpy as jnp
import pytest

from detpg import ALGORITHMS
from detpg.algorithms import COPDACQ
from detpg.critics import QuadraticActionValue
from detpg.policies import LinearPolicy, MLPPolicy
from detpg.testing import PROBES, check_environment, check_probe

RECALLED = {"memory": 5_000, "batch": 64, "warm_up": 200, "tau": 0.05, "gamma": 0.5}
# With these the standard deviation from seed to seed is at most a quarter of what is allowed.
SETTINGS = {
    "bandit-copdac": {"alpha_theta": 0.02},
    "bandit-stochastic-ac": {"alpha_theta": 0.001, "sigma": 0.3},
    "copdac-gq": {"alpha_theta": 0.0004, "alpha_w": 0.1, "alpha_v": 0.05},
    "copdac-q": {"alpha_theta": 0.0004, "alpha_w": 0.1, "alpha_v": 0.05},
    "dac": {"alpha_theta": 0.01, "alpha_w": 0.1},
    "ddpg": RECALLED,
    "offpac": {"alpha_u": 0.001, "alpha_y": 0.0, "alpha_v": 0.05, "sigma0": 0.2},
    "opdac": {"alpha_theta": 0.004, "alpha_w": 0.1, "sigma": 0.3},
    "stochastic-ac": {"alpha_u": 0.00015, "alpha_v": 0.05, "lambda_": 0.5},
    "td3": RECALLED | {"smoothing": 0.0},  # which else widens the hill that is climbed
}
# A learner of Section 5.1 has one action for all states, and no next state.
BANDITS = {"bandit-copdac": ["constant-reward", "best-action"]}
BANDITS["bandit-stochastic-ac"] = BANDITS["bandit-copdac"]
PAIRS = [(name, probe) for name in ALGORITHMS for probe in BANDITS.get(name, PROBES)]


SHAKES = (-0.3, 0.3)


def shaken(probe):
    """The probe, which also shows a number drawn at random: noise that DAC takes from its world."""
    starts = tuple((*seen, shake) for seen in probe.starts for shake in SHAKES)
    actions = tuple(((*seen, 0.0), answer) for seen, answer in probe.actions)
    return dataclasses.replace(probe, starts=starts, actions=actions)


@dataclasses.dataclass(frozen=True)
class Shaky:
    """mu_theta(s) of all but the last number seen, plus that number."""

    policy: LinearPolicy

    def init(self, key):
        return self.policy.init(key)

    def __call__(self, theta, observation):
        return self.policy(theta, observation[:-1]) + observation[-1]


@dataclasses.dataclass(frozen=True)
class Steady:
    """Q^w(s, a) of all but the last number seen: to it the shakes are exploration."""

    action_value: QuadraticActionValue

    def init(self, key):
        return self.action_value.init(key)

    def __call__(self, w, observation, action):
        return self.action_value(w, observation[:-1], action)


@dataclasses.dataclass(frozen=True)
class Quadratics:
    """Q_1 ... Q_K of TD3 that can hold what is true of a probe."""

    action_value: QuadraticActionValue
    size: int

    def init(self, key):
        keys = jax.random.split(key, self.size)
        zeros = jax.vmap(self.action_value.init)(keys)
        return jax.vmap(lambda key, w: w + 0.1 * jax.random.normal(key, w.shape))(keys, zeros)

    def __call__(self, w, observation, action):
        return jax.vmap(self.action_value, in_axes=(0, None, None))(w, observation, action)

    def first(self, w, observation, action):
        return self.action_value(w[0], observation, action)


def made(name, probe):
    """The learner, and the probe that it is given."""
    options = SETTINGS[name]
    if name == "dac" and not probe.actions:  # nothing pulls its actions back where none is better
        options = options | {"policy": MLPPolicy(probe.spec.observation_size, 1, output="tanh")}
    if name in ("ddpg", "td3"):
        size = probe.spec.observation_size
        options = options | {
            "policy": LinearPolicy(size, 1),
            "action_values": Quadratics(QuadraticActionValue(size, 1), 1 if name == "ddpg" else 2),
        }
    if name == "dac" and probe.actions:
        size, probe = probe.spec.observation_size, shaken(probe)
        options = options | {
            "policy": Shaky(LinearPolicy(size, 1)),
            "action_value": Steady(QuadraticActionValue(size, 1)),
        }
    return ALGORITHMS[name].create(probe.spec, **options), probe


@pytest.mark.slow
@pytest.mark.parametrize(("name", "probe"), PAIRS)
def test_every_algorithm_learns(name, probe):
    check_probe(*made(name, PROBES[probe]))


class NoEnd(COPDACQ):
    """Takes a value from what comes after the end."""

    def update(self, key, state, transition):
        open_ended = jnp.zeros_like(transition.terminated)
        return super().update(key, state, dataclasses.replace(transition, terminated=open_ended))


class LimitIsEnd(COPDACQ):
    """Takes a time limit for an end."""

    def update(self, key, state, transition):
        return super().update(
            key, state, dataclasses.replace(transition, terminated=transition.ended)
        )


class OneLate(COPDACQ):
    """Learns the value of s from the reward after s'."""

    def update(self, key, state, transition):
        shifted = dataclasses.replace(transition, observation=transition.next_observation)
        return super().update(key, state, shifted)


class Blind(COPDACQ):
    """Sees always the same."""

    def update(self, key, state, transition):
        same = jnp.ones_like(transition.observation)
        seen = dataclasses.replace(transition, observation=same, next_observation=same)
        return super().update(key, state, seen)


class Descending(COPDACQ):
    """The sign of the actor's direction is wrong."""

    def update(self, key, state, transition):
        after, info = super().update(key, state, transition)
        return dataclasses.replace(after, theta=2 * state.theta - after.theta), info


class Undiscounted(COPDACQ):
    """gamma is not read."""

    def update(self, key, state, transition):
        return dataclasses.replace(COPDACQ(**vars(self)), gamma=1.0).update(key, state, transition)


class Myopic(COPDACQ):
    """What comes next has no value."""

    def update(self, key, state, transition):
        return dataclasses.replace(COPDACQ(**vars(self)), gamma=0.0).update(key, state, transition)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("broken", "probe", "found"),
    [
        (NoEnd, "constant-reward", r"V\(1.0,\) is 2 "),
        (Blind, "seen-reward", r"V\(-1.0,\) is "),
        (OneLate, "two-steps", r"V\(1.0, 0.0\) is "),
        (Undiscounted, "two-steps", r"V\(1.0, 0.0\) is 1 "),
        (Myopic, "two-steps", r"V\(1.0, 0.0\) is 0 "),
        (LimitIsEnd, "time-limit", r"V\(1.0,\) is 1[.][23]"),
        (Descending, "best-action", r"mu\(1.0,\) is "),
        (Blind, "best-line", r"mu\(-1.0,\) is "),
        (Myopic, "consequence", r"mu\(1.0, 0.0\) is "),
    ],
)
def test_a_broken_algorithm_does_not(broken, probe, found):
    learner = broken.create(PROBES[probe].spec, **SETTINGS["copdac-q"])
    with pytest.raises(AssertionError, match=f"^On {probe}, {found}.* was expected: .*[.]$"):
        check_probe(learner, PROBES[probe])


@pytest.mark.parametrize("probe", PROBES)
def test_probes_keep_the_protocol(probe):
    check_environment(PROBES[probe])
