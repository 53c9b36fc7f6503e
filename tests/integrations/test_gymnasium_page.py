"""The code of docs/gymnasium.md, run as a reader would, with a stand-in for the other library."""

import re
import sys
import types
from pathlib import Path

import gymnasium
import numpy as np
import pytest

PAGE = Path(__file__).parents[2] / "docs/gymnasium.md"


class StandIn:
    """Asks of a world what Stable-Baselines3's `check_env` asks, and acts at random."""

    def __init__(self, policy: str, env: gymnasium.Env, seed: int):
        action, observation = env.action_space, env.observation_space
        assert isinstance(action, gymnasium.spaces.Box)
        assert isinstance(observation, gymnasium.spaces.Box)
        np.testing.assert_array_equal(action.low, -1)
        np.testing.assert_array_equal(action.high, 1)
        assert action.dtype == np.float32
        assert len(observation.shape) == 1
        self.env = env
        self.check_observation(*env.reset(seed=seed))

    def check_observation(self, observation, info):
        space = self.env.observation_space
        assert isinstance(observation, np.ndarray)
        assert (observation.shape, observation.dtype) == (space.shape, space.dtype)
        assert np.all(np.isfinite(observation))
        assert observation in space
        assert type(info) is dict

    def learn(self, total_timesteps: int):
        ends = 0
        for _ in range(total_timesteps):
            step = self.env.step(self.env.action_space.sample())
            observation, reward, terminated, truncated, info = step
            assert tuple(map(type, (reward, terminated, truncated))) == (float, bool, bool)
            self.check_observation(observation, info)
            if terminated or truncated:
                ends += 1
                self.check_observation(*self.env.reset())
        assert ends == 1

    def predict(self, observation, deterministic: bool):
        return self.env.action_space.sample(), None


def test_its_code_runs(monkeypatch: pytest.MonkeyPatch):
    other = types.ModuleType("stable_baselines3")
    monkeypatch.setattr(other, "DDPG", StandIn, raising=False)
    monkeypatch.setitem(sys.modules, "stable_baselines3", other)
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(), flags=re.DOTALL)
    assert len(blocks) == 4
    names: dict = {}
    for block in blocks:
        exec(compile(block, str(PAGE), "exec"), names)
    assert names["observations"].shape == (256, 50)
    assert names["step"][0].shape == (256, 50)
    assert names["action"].shape == (20,)
    assert names["problems"] == []
    assert names["outcome"].next_observation.shape == names["starts"].shape == (4, 3)
