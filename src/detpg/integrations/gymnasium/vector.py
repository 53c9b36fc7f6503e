"""A batch of worlds as a `gymnasium.vector.VectorEnv`."""

from collections.abc import Sequence
from typing import Any

import jax
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from detpg.integrations.gymnasium.episodes import Episode, advance, begin, begin_where
from detpg.integrations.gymnasium.parts import (
    PIXELS,
    RENDER_FPS,
    built,
    checked,
    checked_mode,
    draw,
    metadata_of,
    spaces_of,
    started,
)
from detpg.types import Environment

# At the edge, so that batches of one shape share one compilation.
_begin_all = jax.jit(jax.vmap(begin, in_axes=(None, 0)))
_advance_all = jax.jit(jax.vmap(advance, in_axes=(None, 0, 0)))
_begin_where = jax.jit(jax.vmap(begin_where, in_axes=(None, 0, 0, 0, 0)))


class GymnasiumVectorEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Copies of an environment as a `gymnasium.vector.VectorEnv`, one compiled step for them all.

    Step for step what `gymnasium.vector.SyncVectorEnv` gives with the same seeds. Resets follow
    `gymnasium.vector.AutoresetMode`: in the next step; in the same one, with the last observation
    in `info["final_obs"]`; or only when told to, by `options={"reset_mask": ...}`.

    Attributes:
        environment: What is inside each copy.
        episodes: Where the copies stand, a leading axis on every leaf; None before the first reset.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  (as Gymnasium declares it)
        "render_modes": ["rgb_array"],
        "render_fps": RENDER_FPS,
    }

    def __init__(
        self,
        environment: str | Environment,
        num_envs: int = 1,
        render_mode: str | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        **options: Any,
    ):
        """Builds the copies.

        Args:
            environment: Name in `ENVIRONMENTS`, or a record.
            num_envs: How many.
            render_mode: "rgb_array" or None.
            autoreset_mode: When an episode that is over gives way to a new one.
            **options: What the named environment is built with.

        Raises:
            ValueError: An unknown name or mode, no copies, or options for what is built already.
        """
        if num_envs < 1:
            raise ValueError(f"num_envs = {num_envs} is not usable: give 1 or more.")
        self.environment, self.num_envs = built(environment, options), num_envs
        self._mode = AutoresetMode(autoreset_mode)
        metadata = metadata_of(self.environment, self.metadata)
        self.metadata = {**metadata, "autoreset_mode": self._mode}
        self.render_mode = checked_mode(render_mode, self.metadata)
        self.single_observation_space, self.single_action_space = spaces_of(self.environment)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.episodes: Episode | None = None
        self._generators = [seeding.np_random()[0] for _ in range(num_envs)]
        self._observations = np.zeros(self.observation_space.shape or ())
        self._over = np.zeros(num_envs, bool)

    # Gymnasium's property can be set too; here each copy has a generator of its own, set by reset.
    @property
    def np_random(self) -> tuple[np.random.Generator, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Each copy's own generator."""
        return tuple(self._generators)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Starts all copies, or those of `options["reset_mask"]`; copy i has seed `seed + i`."""
        mask = self._mask(options)
        for i, own in enumerate(self._seeds(seed)):
            if mask[i] and own is not None:
                self._generators[i] = seeding.np_random(own)[0]
        self._begin(mask)
        self._over = self._over & ~mask
        return self._observations.copy(), {}

    def step(
        self, actions: Any
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        episodes = started(self.episodes)
        fresh = self._over if self._mode == AutoresetMode.NEXT_STEP else np.zeros_like(self._over)
        self._refuse_ended()
        actions = checked(actions, self.action_space)
        self.episodes, outcome = _advance_all(self.environment, episodes, actions)
        self._observations, reward, *ended = map(np.array, jax.device_get(outcome))
        reward = np.where(fresh, 0.0, reward.astype(np.float64))
        terminated, truncated = (end & ~fresh for end in ended)
        self._over, info = terminated | truncated, {}
        if self._mode == AutoresetMode.SAME_STEP and self._over.any():
            info, fresh = self._final(), self._over
        if fresh.any():
            self._begin(fresh)
        return self._observations.copy(), reward, terminated, truncated, info

    def render(self) -> tuple[np.ndarray, ...] | None:
        """A picture of each copy in mode "rgb_array"; nothing otherwise."""
        if self.render_mode != "rgb_array":
            return None
        from detpg.figures.frames import render

        states = started(self.episodes).state
        each = (jax.tree.map(lambda leaf, at=i: leaf[at], states) for i in range(self.num_envs))
        return tuple(render(self.environment, state, PIXELS) for state in each)

    def _begin(self, mask: np.ndarray) -> None:
        """New episodes where told to; everywhere, if there were none."""
        mask = mask | (self.episodes is None)
        seeds = np.zeros(self.num_envs, np.uint32)
        for i in np.flatnonzero(mask):
            seeds[i] = draw(self._generators[i])
        if self.episodes is None or mask.all():
            self.episodes, seen = _begin_all(self.environment, seeds)
        else:
            self.episodes, seen = _begin_where(
                self.environment, mask, seeds, self.episodes, self._observations
            )
        self._observations = np.array(seen)

    def _final(self) -> dict[str, Any]:
        """The last observations of the episodes that are over, as Gymnasium hands them on."""
        last = np.full(self.num_envs, None, dtype=object)
        for i in np.flatnonzero(self._over):
            last[i] = self._observations[i].copy()
        masks = {"_final_obs": self._over.copy(), "_final_info": self._over.copy()}
        return {"final_obs": last, "final_info": {}, **masks}

    def _refuse_ended(self) -> None:
        if self._mode == AutoresetMode.DISABLED and self._over.any():
            names = ", ".join(map(str, np.flatnonzero(self._over)))
            raise ResetNeeded(
                f"The episodes of the copies {names} are over: reset them with "
                'options={"reset_mask": ...}.'
            )

    def _seeds(self, seed: int | Sequence[int | None] | None) -> Sequence[int | None]:
        if seed is None:
            return [None] * self.num_envs
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int) else seed
        if len(seeds) != self.num_envs:
            raise ValueError(f"{len(seeds)} seeds do not fit {self.num_envs} copies.")
        return seeds

    def _mask(self, options: dict[str, Any] | None) -> np.ndarray:
        every = np.ones(self.num_envs, bool)
        mask = np.asarray((options or {}).get("reset_mask", every))
        if mask.dtype != bool or mask.shape != every.shape or not mask.any():
            raise ValueError(
                f"reset_mask is not usable: give {self.num_envs} booleans, one of them true."
            )
        return mask
