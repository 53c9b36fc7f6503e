"""A stretch of logged data as it was stored: one file, or one episode."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np


class Part(NamedTuple):
    """Rows in their order of time, in the data's own units; nothing is checked yet.

    Attributes:
        row: Says where row number i is, for a message.
        observation: Shape (rows, d).
        action: Shape (rows, m).
        reward: Shape (rows,).
        terminated: Shape (rows,).
        truncated: Shape (rows,).
        next_observation: Shape (rows, d); none: that of the following row of the episode.
        episode: Shape (rows,), a label that changes with the episode; none: the flags tell.
    """

    row: Callable[[int], str]
    observation: np.ndarray
    action: np.ndarray
    reward: np.ndarray
    terminated: np.ndarray
    truncated: np.ndarray
    next_observation: np.ndarray | None = None
    episode: np.ndarray | None = None


def checked(part: Part) -> Part:
    """The part in single precision, if its columns are of one length and its numbers finite.

    Raises:
        ValueError: Names the column, its length or its row.
    """
    columns = {name: x for name, x in part._asdict().items() if isinstance(x, np.ndarray)}
    size = len(part.reward)
    for name, column in columns.items():
        if len(column) != size:
            raise ValueError(
                f"{name} has {len(column)} rows and reward {size} in {part.row(0)}: give one of "
                "each for every step."
            )
    numbers = {
        name: _finite(part, name, column)
        for name, column in columns.items()
        if name in ("observation", "action", "reward", "next_observation")
    }
    if part.next_observation is not None and part.next_observation.shape != part.observation.shape:
        raise ValueError(
            f"next_observation has {part.next_observation.shape[1]} components and observation "
            f"{part.observation.shape[1]} in {part.row(0)}: give as many of both."
        )
    return part._replace(**numbers)


def _finite(part: Part, name: str, column: np.ndarray) -> np.ndarray:
    with np.errstate(over="ignore"):  # what is too large becomes infinite, and is refused
        single = column.astype(np.float32)
    wrong = np.flatnonzero(~np.isfinite(single).reshape(len(single), -1).all(axis=1))
    if wrong.size:
        raise ValueError(
            f"{name} is {column[wrong[0]].tolist()} in {part.row(int(wrong[0]))}, the first of "
            f"{wrong.size}: give finite numbers of single precision, or leave these rows out."
        )
    return single
