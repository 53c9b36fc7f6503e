"""A Gymnasium world on a line: box of actions not around zero, both ways of ending."""

import gymnasium
import numpy as np
from gymnasium.spaces import Box

LENGTHS = ((3, True), (4, False))  # of episodes in turn: steps, and whether the end is terminal


class Slope(gymnasium.Env):
    """x' = 0.8 x + 0.2 a, which earns -(x' - 1)^2; observes [x, steps / 4].

    Attributes:
        given: Every action that was carried out.
        starts: Where episodes began.
    """

    observation_space = Box(-10.0, 10.0, (2,))
    action_space = Box(-1.0, 3.0, (1,))

    def __init__(self):
        self.x, self.steps, self.episode = 0.0, 0, -1
        self.given, self.starts = [], []

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.episode = 0 if seed is not None else self.episode + 1
        self.x, self.steps = self.np_random.uniform(-1.0, 1.0), 0
        self.starts.append(self.x)
        return self.seen(), {}

    def step(self, action):
        assert action in self.action_space
        self.given.append(float(action[0]))
        self.x, self.steps = 0.8 * self.x + 0.2 * float(action[0]), self.steps + 1
        length, terminal = LENGTHS[self.episode % 2]
        over = self.steps == length
        return self.seen(), -((self.x - 1.0) ** 2), over and terminal, over and not terminal, {}

    def seen(self):
        return np.array([self.x, self.steps / 4], np.float32)


class Endless(Slope):
    """The same, without an end."""

    def step(self, action):
        self.steps = 0
        return super().step(action)
