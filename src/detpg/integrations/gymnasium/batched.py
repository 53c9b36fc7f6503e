"""A Gymnasium vector environment, in whichever way it resets its copies."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import Error
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space, iterate

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
from detpg.integrations.gymnasium.returned import (
    THAT,
    UnusableError,
    blame,
    checked_flags,
    checked_reset,
    checked_rewards,
    step_values,
)
from detpg.world_error import WorldError


class BatchedWorlds:
    """A `gymnasium.vector.VectorEnv` as `Worlds`.

    Its autoreset mode decides when an episode that is over gives way to a new one: in the next
    call, which then brings nothing to learn from (`valid`); in the same one, with the last
    observation in `info["final_obs"]`; or when told to, which is done at once.

    Attributes:
        env: What is inside.
        spec: Of each copy.
        num: How many.
        time_limit: Steps, or None where none is known.
        frame_rate: Pictures a second.
    """

    def __init__(self, env: VectorEnv):
        """Takes the vector environment over.

        Raises:
            ValueError: Names a space that cannot be used, or says that there is no autoreset mode.
        """
        self.env, self.num = env, env.num_envs
        self._mode, self.frame_rate = _mode(env), frame_rate(env.metadata)
        self._observations = FlatObservations(env.single_observation_space)
        self._space = batch_space(env.single_observation_space, self.num)
        self._actions = FlatActions(env.single_action_space, self.num)
        name, self.time_limit = _name_and_limit(env.unwrapped)
        own = own_spec(env.unwrapped)
        self.spec = spec_of(name, self._observations, self._actions, self.time_limit, own)
        self._over = np.zeros(self.num, bool)

    def reset(self, seeds: Sequence[int]) -> np.ndarray:
        """New episodes in all copies; one generator for all is seeded with the first seed."""
        seeds = whole_seeds(seeds, self.num)
        try:
            # Gymnasium's own take a list, though the base class speaks of one number.
            observation = self._begun(seed=seeds)
        except WorldError as refused:
            if not isinstance(refused.__cause__, Error | TypeError):
                raise
            observation = self._begun(seed=seeds[0])
        self.env.action_space.seed(seeds[0])
        self.env.single_action_space.seed(seeds[0])
        self._over = np.zeros(self.num, bool)
        return observation

    def step(self, actions: Any) -> Step:
        """One step of each copy."""
        fresh = self._over if self._mode == AutoresetMode.NEXT_STEP else np.zeros(self.num, bool)
        legal = self._actions.legal(actions)
        try:
            returned = self.env.step(legal)
            seen, reward, terminated, truncated = step_values(returned)
            reward = np.where(fresh, np.float32(0), checked_rewards(reward, self.num))
            terminated = checked_flags("terminated", terminated, self.num) & ~fresh
            truncated = checked_flags("truncated", truncated, self.num) & ~fresh
            last = observation = self._flat(seen)
            self._over = terminated | truncated
            if self._over.any() and self._mode == AutoresetMode.SAME_STEP:
                last = self._final(observation, returned[4])
        except Exception as error:  # a world of somebody else's may fail in any way
            blame(self.spec.name, "step", error)
        if self._over.any() and self._mode == AutoresetMode.DISABLED:
            observation = self._restarted(observation)
        return Step(reward, last, terminated, truncated, observation, ~fresh)

    def render(self) -> Any:
        return picture(self.spec.name, self.env)

    def close(self) -> None:
        close_all(self.spec.name, [self.env])

    def _begun(self, **how: Any) -> np.ndarray:
        """Where all copies stand after a reset."""
        try:
            return self._flat(checked_reset(self.env.reset(**how)))
        except Exception as error:  # likewise
            blame(self.spec.name, "reset", error)

    def _flat(self, seen: Any) -> np.ndarray:
        return self._observations.batch(self._space, seen, self.num)

    def _final(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Where the steps led, of which `observation` tells only where no episode ended."""
        kept = info.get("final_obs") if isinstance(info, dict) else None
        if kept is None:
            raise UnusableError(
                "no info['final_obs'], though it resets in the same step: make it with "
                "autoreset_mode=AutoresetMode.NEXT_STEP."
            )
        if not isinstance(kept, np.ndarray | list):
            kept = list(iterate(self._space, kept))
        if len(kept) != self.num:
            raise UnusableError(f"{len(kept)} info['final_obs'] instead of {self.num}: {THAT}.")
        flat, memory = self._observations.rows(self.num)
        flat[...] = observation
        for i in np.flatnonzero(self._over).tolist():
            self._observations.put(memory, i, kept[i])
        return flat

    def _restarted(self, observation: np.ndarray) -> np.ndarray:
        """Where all copies stand once those that are over have begun anew."""
        begun = self._begun(options={"reset_mask": self._over.copy()})
        return np.where(self._over[:, None], begun, observation)


def _mode(env: VectorEnv) -> AutoresetMode:
    try:
        return AutoresetMode(env.metadata.get("autoreset_mode"))
    except ValueError as error:
        modes = ", ".join(mode.value for mode in AutoresetMode)
        raise ValueError(
            f"{type(env.unwrapped).__name__} does not say when it resets its copies: set its "
            f"metadata['autoreset_mode'] to one of {modes}."
        ) from error


def _name_and_limit(env: VectorEnv) -> tuple[str, int | None]:
    """From what made it, from this library's own environment, or from the first copy."""
    copies: Sequence[gymnasium.Env] = getattr(env, "envs", ())
    own, spec = own_spec(env), env.spec
    known = limit_of(copies[0]) if copies else None
    if own is not None:
        known = own.time_limit
    elif known is None and spec is not None:
        known = spec.kwargs.get("max_episode_steps", spec.max_episode_steps)
    return name_of(copies[0].unwrapped if spec is None and copies else env), known
