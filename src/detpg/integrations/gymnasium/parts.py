"""What one world and a batch of them have in common: what is refused, spaces, seeds."""

from typing import Any

import gymnasium
import jax
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box

from detpg.environments import ENVIRONMENTS
from detpg.integrations.gymnasium.episodes import Episode, begin
from detpg.types import Environment

PIXELS, RENDER_FPS = 480, 20
# Those in `detpg.figures.frames.FRAMES`: named here, so that matplotlib is imported only to draw.
PICTURED = ("mountain-car", "octopus-arm", "pendulum", "puddle-world")


def built(environment: str | Environment, options: dict[str, Any]) -> Environment:
    """The named environment with its options, or the one given."""
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


def metadata_of(environment: Environment, metadata: dict[str, Any]) -> dict[str, Any]:
    """What the class declares, without render modes where there is no picture."""
    modes = metadata["render_modes"] if environment.spec.name in PICTURED else []
    return {**metadata, "render_modes": list(modes)}


def checked_mode(mode: str | None, metadata: dict[str, Any]) -> str | None:
    """The render mode, if there is such a one."""
    modes = metadata["render_modes"]
    if mode is not None and mode not in modes:
        known = f"choose one of {', '.join(modes)}" if modes else "this environment has no picture"
        raise ValueError(f"render_mode {mode!r} is unknown: {known}.")
    return mode


def spaces_of(environment: Environment) -> tuple[Box, Box]:
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


def draw(generator: np.random.Generator) -> np.uint32:
    """The seed of an episode."""
    return generator.integers(2**32, dtype=np.uint32)


def started(episode: Episode | None) -> Episode:
    """The episode, if there is one."""
    if episode is None:
        raise ResetNeeded("There is no episode yet: call reset() first.")
    return episode


def checked(action: Any, space: gymnasium.Space) -> np.ndarray:
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
