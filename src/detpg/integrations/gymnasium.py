"""The environments under Gymnasium's interface: one world, or a batch of them compiled as one.

Importing this module registers every environment of `detpg.environments.ENVIRONMENTS` as
`detpg/<class>-v0`; keyword arguments of `gymnasium.make` go to the class:

    import gymnasium
    import detpg.integrations.gymnasium

    world = gymnasium.make("detpg/OctopusArm-v0", num_segments=8)
    worlds = gymnasium.make_vec("detpg/OctopusArm-v0", num_envs=256)
"""

from collections.abc import Sequence
from typing import Any

import gymnasium
import jax
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from detpg.environments import ENVIRONMENTS
from detpg.integrations.episodes import Episode, advance, begin, begin_where
from detpg.types import Environment

PIXELS, RENDER_FPS = 480, 20
# Those in `detpg.figures.frames.FRAMES`: named here, so that matplotlib is imported only to draw.
PICTURED = ("mountain-car", "octopus-arm", "pendulum", "puddle-world")

# At the edge, so that worlds of one shape share one compilation.
_begin, _advance = jax.jit(begin), jax.jit(advance)
_begin_all = jax.jit(jax.vmap(begin, in_axes=(None, 0)))
_advance_all = jax.jit(jax.vmap(advance, in_axes=(None, 0, 0)))
_begin_where = jax.jit(jax.vmap(begin_where, in_axes=(None, 0, 0, 0, 0)))


class GymnasiumEnv(gymnasium.Env[np.ndarray, np.ndarray]):
    """An environment of this library as a `gymnasium.Env`.

    The time limit is the environment's own and gives `truncated`. Actions outside the box are what
    the environment makes of them: the paper's tasks cap them. All that is random follows from
    `reset(seed=...)`.

    Attributes:
        environment: What is inside.
        episode: Where it stands; None before the first reset.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  (as Gymnasium declares it)
        "render_modes": ["human", "rgb_array"],
        "render_fps": RENDER_FPS,
    }

    def __init__(
        self,
        environment: str | Environment,
        render_mode: str | None = None,
        **options: Any,
    ):
        """Builds an environment, or takes one's own.

        Args:
            environment: Name in `ENVIRONMENTS`, or a record.
            render_mode: "rgb_array", "human" (a window, drawn at each step) or None.
            **options: What the named environment is built with.

        Raises:
            ValueError: An unknown name or render mode, or options for what is built already.
        """
        self.environment = _built(environment, options)
        self.metadata = _metadata(self.environment, self.metadata)
        self.render_mode = _checked_mode(render_mode, self.metadata)
        self.observation_space, self.action_space = _spaces(self.environment)
        self.episode: Episode | None = None
        self._action: np.ndarray | None = None
        self._window = _open_window(self.environment) if render_mode == "human" else None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        super().reset(seed=seed)
        self.episode, observation = _begin(self.environment, _draw(self.np_random))
        self._action = None
        self._show()
        return np.array(observation), {}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        episode = _started(self.episode)
        self._action = _checked(action, self.action_space)
        self.episode, outcome = _advance(self.environment, episode, self._action)
        self._show()
        observation, reward, terminated, truncated = jax.device_get(outcome)
        return np.array(observation), float(reward), bool(terminated), bool(truncated), {}

    def render(self) -> np.ndarray | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The picture as uint8, shape (480, 480, 3), in mode "rgb_array"; nothing otherwise."""
        if self.render_mode != "rgb_array":
            return None
        return self._picture()

    def close(self) -> None:
        if self._window is not None:
            self._window.close()

    def _picture(self) -> np.ndarray:
        from detpg.figures.frames import render

        return render(self.environment, _started(self.episode).state, PIXELS, self._action)

    def _show(self) -> None:
        if self._window is not None:
            self._window.show(self._picture(), 1 / RENDER_FPS)


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
        self.environment, self.num_envs = _built(environment, options), num_envs
        self._mode = AutoresetMode(autoreset_mode)
        metadata = _metadata(self.environment, self.metadata)
        self.metadata = {**metadata, "autoreset_mode": self._mode}
        self.render_mode = _checked_mode(render_mode, self.metadata)
        self.single_observation_space, self.single_action_space = _spaces(self.environment)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.episodes: Episode | None = None
        self._generators = [seeding.np_random()[0] for _ in range(num_envs)]
        self._observations = np.zeros(self.observation_space.shape or ())
        self._over = np.zeros(num_envs, bool)

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
        episodes = _started(self.episodes)
        fresh = self._over if self._mode == AutoresetMode.NEXT_STEP else np.zeros_like(self._over)
        self._refuse_ended()
        actions = _checked(actions, self.action_space)
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

        states = jax.device_get(_started(self.episodes).state)
        each = (jax.tree.map(lambda leaf, at=i: leaf[at], states) for i in range(self.num_envs))
        return tuple(render(self.environment, state, PIXELS) for state in each)

    def _begin(self, mask: np.ndarray) -> None:
        """New episodes where told to; everywhere, if there were none."""
        mask = mask | (self.episodes is None)
        seeds = np.zeros(self.num_envs, np.uint32)
        for i in np.flatnonzero(mask):
            seeds[i] = _draw(self._generators[i])
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


def _built(environment: str | Environment, options: dict[str, Any]) -> Environment:
    if not isinstance(environment, str):
        if options:
            raise ValueError(
                f"The environment is built already and takes no {', '.join(options)}: give its "
                "name instead, or build it with them."
            )
        return environment
    if environment not in ENVIRONMENTS:
        known = ", ".join(ENVIRONMENTS)
        raise ValueError(f"environment {environment!r} is unknown: choose one of {known}.")
    return ENVIRONMENTS[environment](**options)


def _metadata(environment: Environment, metadata: dict[str, Any]) -> dict[str, Any]:
    """What the class declares, without render modes where there is no picture."""
    modes = metadata["render_modes"] if environment.spec.name in PICTURED else []
    return {**metadata, "render_modes": list(modes)}


def _checked_mode(mode: str | None, metadata: dict[str, Any]) -> str | None:
    modes = metadata["render_modes"]
    if mode is not None and mode not in modes:
        known = f"choose one of {', '.join(modes)}" if modes else "this environment has no picture"
        raise ValueError(f"render_mode {mode!r} is unknown: {known}.")
    return mode


def _spaces(environment: Environment) -> tuple[Box, Box]:
    """Of the observation, unbounded where bounds are not known, and of the action."""
    spec = environment.spec
    _, seen = jax.eval_shape(begin, environment, np.uint32(0))
    low = spec.observation_low or (-np.inf,) * spec.observation_size
    high = spec.observation_high or (np.inf,) * spec.observation_size
    boxes = ((low, high), (spec.action_low, spec.action_high))
    observation, action = (
        Box(np.asarray(low, seen.dtype), np.asarray(high, seen.dtype), dtype=seen.dtype.type)
        for low, high in boxes
    )
    return observation, action


def _draw(generator: np.random.Generator) -> np.uint32:
    """The seed of an episode."""
    return generator.integers(2**32, dtype=np.uint32)


def _started(episode: Episode | None) -> Episode:
    if episode is None:
        raise ResetNeeded("There is no episode yet: call reset() first.")
    return episode


def _checked(action: Any, space: gymnasium.Space) -> np.ndarray:
    """The action in the space's shape and dtype; a NaN would spread through the state unseen."""
    action = np.asarray(action, space.dtype)
    if action.shape != space.shape:
        raise ValueError(f"The action has shape {action.shape}: give one of shape {space.shape}.")
    missing = np.argwhere(np.isnan(action)).tolist()
    if missing:
        raise ValueError(
            f"The action has {len(missing)} NaN, the first at {missing[0]}: give finite numbers."
        )
    return action


def _open_window(environment: Environment) -> Any:
    from detpg.figures.window import Window

    return Window(environment.spec.name)


def _register() -> None:
    for name, environment in ENVIRONMENTS.items():
        gymnasium.register(
            id=f"detpg/{environment.__name__}-v0",
            entry_point=f"{__name__}:GymnasiumEnv",
            vector_entry_point=f"{__name__}:GymnasiumVectorEnv",
            kwargs={"environment": name},
        )


_register()
