"""Small Gymnasium worlds whose every number is known."""

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import SyncVectorEnv

from detpg.integrations.gymnasium.worlds import open_worlds

# How the episodes of `Counting` end, in turn: (terminated, truncated) after so many steps. The seed
# says which comes first, so that worlds side by side end apart.
ENDS = ((3, True, False), (2, False, True), (4, True, True))


class Counting(gymnasium.Env):
    """Observes [seed, episode, step]; earns 10 episode + step + action; ends as in ENDS."""

    observation_space = Box(-np.inf, np.inf, (3,))
    action_space = Box(-1.0, 1.0, (1,))

    def __init__(self, render_mode=None):
        self.render_mode, self.seed, self.episode, self.steps = render_mode, -1, -1, 0
        self.actions = []

    def seen(self):
        return np.array([self.seed, self.episode, self.steps], np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        if seed is not None:
            self.seed, self.episode = seed, -1
        self.episode, self.steps = self.episode + 1, 0
        return self.seen(), {}

    def step(self, action):
        assert action in self.action_space
        self.actions.append(action)
        self.steps += 1
        length, terminated, truncated = ENDS[(self.episode + self.seed) % len(ENDS)]
        over = self.steps == length
        reward = 10 * self.episode + self.steps + float(np.sum(action))
        return self.seen(), reward, terminated and over, truncated and over, {}


class Spaced(gymnasium.Env):
    """A world of any spaces that shows what it was given and never ends."""

    def __init__(self, observation_space, action_space, seen=None):
        self.observation_space, self.action_space = observation_space, action_space
        self.given, self._seen = [], seen

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self.seen(), {}

    def step(self, action):
        self.given.append(action)
        return self.seen(), 0.0, False, False, {}

    def seen(self):
        return self.observation_space.sample() if self._seen is None else self._seen


def opened(mode, num, make=Counting):
    """Plain worlds, or the same ones in a vector environment."""
    if mode is None:
        return open_worlds(make, num)
    return open_worlds(SyncVectorEnv([make] * num, autoreset_mode=mode))
