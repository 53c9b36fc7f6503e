"""Minari data sets, recorded here, read to be learnt from."""

import re
import subprocess
import sys
import warnings

import gymnasium
import jax
import numpy as np
import pytest
from gymnasium.spaces import Box, Dict, Discrete, MultiBinary, Tuple, flatten

from detpg.algorithms import OPDAC
from detpg.environments import LQR
from detpg.integrations.gymnasium import GymnasiumEnv
from detpg.integrations.logged import minari as minari_sets
from detpg.integrations.logged import read
from detpg.replaying import learn_from
from detpg.types import Bounds
from logs import POOR, ROWS, nearness, opdac_gains, riccati


def refusal(name):
    with pytest.raises(ValueError) as caught:  # noqa: PT011  (the test reads the sentence)
        read(name)
    said = str(caught.value)
    assert said.endswith(".")
    assert "\n" not in said
    return said


@pytest.fixture
def minari(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    return pytest.importorskip("minari")


def record(minari, world, act, episodes, name):
    """A data set of a few episodes; missing authors and scores are none of our business."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        collector = minari.DataCollector(world)
        for seed in range(episodes):
            observation, _ = collector.reset(seed=seed)
            ended = False
            while not ended:
                step = collector.step(act(observation))
                observation, ended = step[0], step[2] or step[3]
        collector.create_dataset(name)
        collector.close()
        del collector  # leaves a temporary folder to the garbage collector, which warns of it


class Short(gymnasium.Env):
    """Ends after three steps; its observations have every kind of part."""

    observation_space = Dict(
        {
            "pair": Tuple((Box(-1, 1, (2, 2)), Discrete(3))),
            "bits": MultiBinary(2),
            "angle": Box(-5, 5, (1,)),
        }
    )
    action_space = Box(np.float32([-2, 0]), np.float32([2, 1]))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.steps = 0
        self.observation_space.seed(seed)
        return self._seen(), {}

    def step(self, action):
        self.steps += 1
        return self._seen(), float(self.steps), self.steps == 3, False, {}

    def _seen(self):
        self.last = self.observation_space.sample()
        return self.last


class Remembering(gymnasium.Wrapper):
    """Keeps every observation, flattened by Gymnasium itself."""

    def __init__(self, env):
        super().__init__(env)
        self.flat = []

    def reset(self, **options):
        observation, info = self.env.reset(**options)
        self.flat.append(flatten(self.observation_space, observation))
        return observation, info

    def step(self, action):
        found = self.env.step(action)
        self.flat.append(flatten(self.observation_space, found[0]))
        return found


def test_observations_of_a_minari_set_are_flattened_as_gymnasium_does(minari, tmp_path):
    world = Remembering(Short())
    record(minari, world, lambda _: np.float32([1, 1]), 2, "short/test-v0")
    data = read("short/test-v0")
    flat = np.asarray(world.flat, np.float32)
    np.testing.assert_array_equal(data.observation, flat[[0, 1, 2, 4, 5, 6]])
    np.testing.assert_array_equal(data.next_observation, flat[[1, 2, 3, 5, 6, 7]])
    assert data.terminated.tolist() == [False, False, True] * 2
    assert data.episode.tolist() == [0, 0, 0, 1, 1, 1]
    assert data.bounds == Bounds((-2.0, 0.0), (2.0, 1.0))
    np.testing.assert_array_equal(data.action, np.full((6, 2), [0.5, 1], np.float32))
    by_folder = read(tmp_path / "short" / "test-v0")
    assert jax.tree.all(jax.tree.map(np.array_equal, by_folder, data))


def test_the_last_observation_of_a_cut_episode_is_bootstrapped_from(minari):
    generator = np.random.default_rng(0)
    world = gymnasium.make("Pendulum-v1", max_episode_steps=5)
    record(minari, world, lambda _: generator.uniform(-2, 2, 1).astype("f"), 3, "pendulum/test-v0")
    data = read("pendulum/test-v0")
    assert data.observation.shape == (15, 3)
    assert data.truncated.tolist() == ([False] * 4 + [True]) * 3
    assert not data.terminated.any()
    within = [i for i in range(14) if i % 5 != 4]
    np.testing.assert_array_equal(
        data.next_observation[within], data.observation[[i + 1 for i in within]]
    )
    # the last is no other row's observation, and a state of the pendulum
    last = data.next_observation[4::5]
    assert not (last[:, None] == data.observation[None]).all(axis=-1).any()
    np.testing.assert_allclose(last[:, 0] ** 2 + last[:, 1] ** 2, 1, rtol=1e-6)
    learner = OPDAC.create(data.spec(0.99), alpha_w=1e-4)
    state, log = jax.jit(learn_from, static_argnames="steps")(learner, data, jax.random.key(0), 40)
    assert np.isfinite(np.asarray(log.info.delta)).all()
    assert state.learner.theta.shape == (1, 3)


def test_a_minari_set_of_the_regulator_gives_the_riccati_gain(minari):
    """Recorded through Gymnasium, by a poor gain with uniform noise."""
    generator, gain = np.random.default_rng(0), np.asarray(POOR)

    def act(observation):
        return (gain @ observation + generator.uniform(-1, 1, 1)).astype(np.float32)

    record(minari, GymnasiumEnv(LQR()), act, ROWS // LQR().spec.time_limit, "lqr/poor-v0")
    data = read("lqr/poor-v0")
    assert (len(data), data.bounds) == (ROWS, Bounds.unbounded(1))
    learner = OPDAC.create(data.spec(LQR().gamma), alpha_w=0.01, alpha_theta=0.003)
    run = jax.jit(learn_from, static_argnames="steps")
    state, _ = run(learner, data, jax.random.key(0), 20_000)
    # of logs of this size OPDAC's gains have this standard deviation
    best, (_, _, error) = riccati()[0], opdac_gains()
    assert np.all(np.abs(np.asarray(state.learner.theta) - best) < 4.5 * error)
    assert 4.5 * np.max(error) < 0.2 * nearness()


def test_minari_sets_that_are_none_are_refused(minari, tmp_path, monkeypatch):
    assert "is no file, folder or local Minari data set" in refusal("nobody/has-v0")
    assert "is no file, folder or local Minari data set" in refusal("nowhere to be found")
    record(minari, gymnasium.make("CartPole-v1"), lambda _: 0, 1, "cart/test-v0")
    assert re.search(r"actions of cart/test-v0 are of Discrete\(2\), but", refusal("cart/test-v0"))
    monkeypatch.setitem(sys.modules, "minari", None)
    assert "need the package minari" in refusal("short/test-v0")


def test_an_episode_without_its_last_observation_is_refused(minari, monkeypatch):
    record(minari, Short(), lambda _: np.float32([1, 1]), 1, "short/cut-v0")
    whole = minari_sets.flattened
    monkeypatch.setattr(minari_sets, "flattened", lambda space, x: whole(space, x)[:3])
    assert "has 3 observations for 3 steps: 4 are needed" in refusal("short/cut-v0")


def test_minari_is_imported_when_it_is_needed():
    code = "import sys, detpg.integrations.logged; sys.exit('minari' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
