"""A Gymnasium world without fault, and what `check_gymnasium` finds in worlds."""

import gymnasium
import numpy as np
from gymnasium.spaces import Box

from detpg.testing import Finding, check_gymnasium

LENGTH = 20


class Point(gymnasium.Env):
    """A point that is pushed about, with noise, and earns by being near 0: nothing is wrong."""

    observation_space = Box(-10.0, 10.0, (2,))
    action_space = Box(-1.0, 1.0, (1,))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place = self.np_random.uniform(-1, 1, 2).astype(np.float32)
        self.steps = 0
        return self.place.copy(), {}

    def step(self, action):
        self.steps += 1
        noise = 0.1 * self.np_random.normal(size=2)
        self.place = np.clip(0.9 * self.place + action + noise, -10, 10).astype(np.float32)
        return self.place.copy(), self.reward(), False, False, {}

    def reward(self):
        return -float(np.sum(self.place**2))


class Falling(Point):
    """Ends by itself, sooner or later."""

    def step(self, action):
        seen, reward, *_ = super().step(action)
        return seen, reward, bool(abs(self.place[0]) > 1.5), False, {}


def checked(make, limit=LENGTH, steps=400, **options):
    return check_gymnasium(make, time_limit=limit, steps=steps, **options)


def of(findings, check) -> Finding:
    (found,) = [finding for finding in findings if finding.check == check]
    return found


def bad(findings) -> dict[str, str]:
    return {f.check: f.level for f in findings if f.level != "fine" and "Gymnasium" not in f.check}
