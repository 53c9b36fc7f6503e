"""Gymnasium environments side by side, stepped one by one and reset at once."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces.utils import flatdim

from detpg.integrations.gymnasium.filming import frame_rate
from detpg.integrations.gymnasium.flat import FlatActions, FlatObservations
from detpg.integrations.gymnasium.hosted import (
    Step,
    close_all,
    limit_of,
    name_of,
    own_spec,
    picture,
    spec_of,
    whole_seeds,
)
from detpg.integrations.gymnasium.returned import blame, checked_reset, checked_step


class PlainWorlds:
    """A list of `gymnasium.Env` as `Worlds`.

    Attributes:
        envs: The environments.
        spec: Of each.
        num: How many.
        time_limit: Steps, or None where none is known.
        frame_rate: Pictures a second.
    """

    def __init__(self, envs: Sequence[gymnasium.Env]):
        """Takes the environments over.

        Raises:
            ValueError: Names a space that cannot be used, or says that the spaces differ.
        """
        first = envs[0]
        self.envs, self.num = envs, len(envs)
        self._observations = FlatObservations(first.observation_space)
        self._actions = FlatActions(first.action_space, self.num)
        self._check_alike()
        self.frame_rate = frame_rate(first.metadata)
        self.time_limit, own = limit_of(first), own_spec(first.unwrapped)
        name = name_of(first.unwrapped)
        self.spec = spec_of(name, self._observations, self._actions, self.time_limit, own)
        self._valid = np.ones(self.num, bool)
        self._valid.flags.writeable = False  # one for all steps

    def reset(self, seeds: Sequence[int]) -> np.ndarray:
        """New episodes in all worlds; a seed is the world's and its action space's."""
        flat, memory = self._observations.rows(self.num)
        for i, seed in enumerate(whole_seeds(seeds, self.num)):
            self._begin(memory, i, seed=seed)
            self.envs[i].action_space.seed(seed)
        return flat

    def step(self, actions: Any) -> Step:
        """One step of each world, and a reset of those that are over."""
        legal = self._actions.legal(actions)
        last, memory = self._observations.rows(self.num)
        reward = np.empty(self.num, np.float32)
        terminated, truncated = np.empty(self.num, bool), np.empty(self.num, bool)
        over, i = [], 0
        try:
            for i, env in enumerate(self.envs):
                seen, reward[i], end, cut = checked_step(env.step(legal[i, ...]))
                self._observations.put(memory, i, seen)
                terminated[i], truncated[i] = end, cut
                if end or cut:
                    over.append(i)
        except Exception as error:  # a world of somebody else's may fail in any way
            blame(self.spec.name, "step", error, i)
        observation = self.begun_anew(last, over) if over else last
        return Step(reward, last, terminated, truncated, observation, self._valid)

    def render(self) -> Any:
        return picture(self.spec.name, self.envs[0])

    def close(self) -> None:
        close_all(self.spec.name, self.envs)

    def begun_anew(self, observation: np.ndarray, over: Sequence[int]) -> np.ndarray:
        """Where all worlds stand once some have begun anew, of where they stood."""
        flat, memory = self._observations.rows(self.num)
        flat[...] = observation
        for i in over:
            self._begin(memory, i)
        return flat

    def _begin(self, memory: np.ndarray, i: int, **how: Any) -> None:
        try:
            self._observations.put(memory, i, checked_reset(self.envs[i].reset(**how)))
        except Exception as error:  # likewise
            blame(self.spec.name, "reset", error, i)

    def _check_alike(self) -> None:
        spaces = self._actions.space, self._observations.size
        for i, env in enumerate(self.envs):
            if (env.action_space, int(flatdim(env.observation_space))) != spaces:
                raise ValueError(
                    f"World {i} has another action space or observation size than world 0: let "
                    "what makes them make worlds of one kind."
                )
