"""A stretch of logged data as it was stored: one file, or one episode."""

import warnings
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from detpg.integrations.logged.clocks import Clock

LOST = 0.01  # of what a number varies by: what single precision may lose of it
ROUNDED = 1e-12  # of a number: what may be rounding in double precision, and no signal
NUMBERS = ("observation", "action", "reward", "next_observation")
WHOLE = 2.0**24  # from here on single precision makes one number of several whole ones


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
        episode: Shape (rows,), a label of its own for each episode; none: the flags tell.
        clocks: What else tells the order of the rows.
    """

    row: Callable[[int], str]
    observation: np.ndarray
    action: np.ndarray
    reward: np.ndarray
    terminated: np.ndarray
    truncated: np.ndarray
    next_observation: np.ndarray | None = None
    episode: np.ndarray | None = None
    clocks: Sequence[Clock] = ()


def ends(part: Part) -> np.ndarray:
    """Whether an episode ends with a row: it is said, or the data break off."""
    found = part.terminated | part.truncated
    found[-1:] = True
    if part.episode is not None:
        found[:-1] |= part.episode[1:] != part.episode[:-1]
    return found


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
    numbers = {}
    for name in [x for x in NUMBERS if x in columns]:  # not inside: what warns counts frames
        column = columns[name]
        if name == "next_observation":  # nobody looks at it where the episode has terminated
            column = np.where(part.terminated[:, None] & (column != column), 0, column)
        numbers[name] = _finite(part, name, column)
    if part.next_observation is not None and part.next_observation.shape != part.observation.shape:
        raise ValueError(
            f"next_observation has {part.next_observation.shape[1]} components and observation "
            f"{part.observation.shape[1]} in {part.row(0)}: give as many of both."
        )
    if part.episode is not None:
        _check_labels(part, part.episode)
    return part._replace(**numbers)


def _check_labels(part: Part, label: np.ndarray) -> None:
    """Refuses a row of no episode, and labels that cannot be told apart."""
    is_number = label.dtype.kind == "f"
    lost = np.flatnonzero([x is None for x in label] if label.dtype.kind == "O" else label != label)
    if lost.size:
        raise ValueError(
            f"episode is {label[lost[0]]} in {part.row(int(lost[0]))}, the first of {lost.size}: "
            "give every row the label of its episode, or leave these rows out."
        )
    if is_number and np.spacing(np.max(np.abs(label))) > 1:
        raise ValueError(
            f"episode reaches {np.max(np.abs(label)):g} in {part.row(int(np.argmax(abs(label))))}, "
            f"where {label.dtype} makes one number of several: give whole numbers or text."
        )


def _finite(part: Part, name: str, column: np.ndarray) -> np.ndarray:
    with np.errstate(over="ignore"):  # what is too large becomes infinite, and is refused
        single = column.astype(np.float32)
    wrong = np.flatnonzero(~np.isfinite(single).reshape(len(single), -1).all(axis=1))
    if wrong.size:
        raise ValueError(
            f"{name} is {column[wrong[0]].tolist()} in {part.row(int(wrong[0]))}, the first of "
            f"{wrong.size}: give finite numbers of single precision, or leave these rows out."
        )
    _check_precision(part, name, column.reshape(len(single), -1), single.reshape(len(single), -1))
    return single


def _check_precision(part: Part, name: str, column: np.ndarray, single: np.ndarray) -> None:
    """Refuses numbers of which single precision loses what they differ by; tells of whole ones."""
    if column.dtype.itemsize <= single.dtype.itemsize and column.dtype.kind == "f":
        return
    exact = column.astype(np.longdouble)
    error = np.max(np.abs(exact - single), axis=0)
    # Of the values that differ: a number that seldom changes varies too.
    spread = np.asarray([np.std(np.unique(x) - x[0]) for x in exact.T])
    noise = 0.0 if column.dtype.kind in "iu" else ROUNDED * np.max(np.abs(exact), axis=0)
    lost = np.flatnonzero((spread > noise) & (error > LOST * spread))
    if lost.size:
        k = int(lost[0])
        raise ValueError(
            f"{_component(name, k, column)} is about {exact[0, k]:g} and varies by {spread[k]:.2g} "
            f"from {part.row(0)} on, of which single precision loses {error[k]:.2g}: subtract a "
            "constant, such as the first value, before it is logged."
        )
    for k in np.flatnonzero(np.max(np.abs(single), axis=0) >= WHOLE):
        _check_whole(part, _component(name, int(k), column), column[:, k], single[:, k])


def _check_whole(part: Part, words: str, column: np.ndarray, single: np.ndarray) -> None:
    order = np.argsort(column, kind="stable")
    merged = (np.diff(single[order]) == 0) & (column[order[1:]] != column[order[:-1]])
    if np.all(column == np.round(column)) and merged.any():
        i, j = (int(order[np.argmax(merged) + k]) for k in (0, 1))
        warnings.warn(
            f"{words} is {column[i]:.0f} in {part.row(i)} and {column[j]:.0f} in {part.row(j)}, of "
            f"which single precision makes one number (the first of {merged.sum()}): log smaller "
            "numbers if the difference matters.",
            stacklevel=7,
        )


def _component(name: str, k: int, column: np.ndarray) -> str:
    return name if column.shape[1] == 1 else f"component {k} of {name}"
