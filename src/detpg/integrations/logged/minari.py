"""Transitions of a Minari data set, by its folder or the name of a local one."""

from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Dict, Space, Tuple, flatten

from detpg.integrations.logged.parts import Part
from detpg.types import Bounds


def parts(name: str) -> tuple[list[Part], Bounds]:
    """Each episode, and the box of the action space.

    Raises:
        ValueError: No such data set, actions that are no vectors of numbers, a missing package.
    """
    data = _opened(name)
    space = data.action_space
    if not isinstance(space, Box):
        raise ValueError(
            f"The actions of {name} are of {space}, but a deterministic policy gradient needs "
            "continuous ones: give a data set whose action space is a Box."
        )
    low, high = (tuple(map(float, np.ravel(end))) for end in (space.low, space.high))
    seen = data.observation_space
    return [_part(name, episode, seen, space) for episode in data], Bounds(low, high)


def _opened(name: str) -> Any:
    try:
        import minari
    except ImportError as error:
        raise ValueError(
            f"{name} is no Parquet file, and Minari data sets need the package minari "
            f"({error}): install detpg[minari]."
        ) from error
    try:
        if Path(name).exists():
            return minari.MinariDataset(Path(name) / "data")
        return minari.load_dataset(name)
    # Minari parses a name without saying what is wrong with it.
    except (OSError, ValueError, KeyError, TypeError, ImportError) as error:
        raise ValueError(
            f"{name} is no file, folder or local Minari data set that can be read "
            f"({str(error).splitlines()[0]}): give a path, or a name out of `minari list local`."
        ) from error


def _part(name: str, episode: Any, seen: Space, space: Space) -> Part:
    size = len(episode.rewards)
    observations = flattened(seen, episode.observations)
    if len(observations) != size + 1:
        raise ValueError(
            f"Episode {episode.id} of {name} has {len(observations)} observations for {size} "
            f"steps: {size + 1} are needed, the last one after the last step."
        )
    return Part(
        row=lambda i: f"step {i} of episode {episode.id} of {name}",
        observation=observations[:-1],
        action=flattened(space, episode.actions),
        reward=np.asarray(episode.rewards),
        terminated=np.asarray(episode.terminations, bool),
        truncated=np.asarray(episode.truncations, bool),
        next_observation=observations[1:],
    )


def flattened(space: Space, values: Any) -> np.ndarray:
    """Each of several values as `gymnasium.spaces.flatten` has it, a row each.

    Args:
        space: What one value is of.
        values: Arrays with a leading axis over values, in dictionaries and tuples as the space is.
    """
    if isinstance(space, Box):
        values = np.asarray(values)
        return values.reshape(len(values), -1)
    if isinstance(space, Dict):
        inside = [flattened(one, values[name]) for name, one in space.items()]
        return np.concatenate(inside, axis=1)
    if isinstance(space, Tuple):
        return np.concatenate([flattened(*pair) for pair in zip(space, values)], axis=1)
    return np.stack([np.asarray(flatten(space, value)) for value in values])
