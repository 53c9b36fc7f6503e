"""From the parts as they were stored to transitions that can be learnt from."""

import math
import warnings
from collections.abc import Sequence

import numpy as np

from detpg.integrations.logged.ordering import in_order
from detpg.integrations.logged.parts import Part, checked, ends
from detpg.replaying import Logged
from detpg.types import Bounds

# Of the half range: what an action may lie outside the box by rounding.
ROUNDING = 1e-5


def assembled(name: str, parts: Sequence[Part], bounds: Bounds | None) -> Logged:
    """The parts as one: next observations found, episodes numbered, actions in units of the box.

    Args:
        name: Of the data, for a message.
        parts: In their order; no episode goes on in the next one.
        bounds: The box of legal actions; none: the least and greatest seen.

    Raises:
        ValueError: Says what is wrong with the data, where, and how to mend it.
    """
    parts = [part for part in parts if len(part.reward)]
    if not parts:
        raise ValueError(f"{name} holds no rows: record some steps first.")
    for i, part in enumerate(parts):  # a loop, not a list: what warns counts frames
        parts[i] = in_order(checked(part))
    _check_sizes(parts)
    bounds = (_seen(parts) if bounds is None else bounds).meant
    for part in parts:
        check_inside(part, bounds)
    columns, first = [], 0
    for part in parts:
        columns.append(_transitions(part, first))
        first += int(ends(part).sum())
    observation, action, *others = (np.concatenate(column) for column in zip(*columns))
    if not len(observation):
        raise ValueError(
            f"{name} has no next_observation, and no row is followed by another of its episode: "
            "add the column; or, if rows of several episodes take turns, give each a label in the "
            "column episode and sort the rows by it and then by time."
        )
    reward, following, terminated, truncated, episode = others
    centre, half = (np.asarray(x, np.float32) for x in (bounds.centre, bounds.half_range))
    action = (action - centre) / half
    flags = terminated, truncated
    return Logged(observation, action, reward, following, *flags, episode, bounds)


def _transitions(part: Part, first: int) -> tuple[np.ndarray, ...]:
    """Observation, action, reward, next observation, terminated, truncated, episode.

    Without next observations the last row of a cut episode has none, and is dropped; that of a
    terminated one needs none, and has its own observation in the place.
    """
    over, terminated = ends(part), part.terminated
    episode = (first + np.cumsum(over) - over).astype(np.int32)
    if part.next_observation is None:
        following = np.roll(part.observation, -1, axis=0)
        following = np.where(terminated[:, None], part.observation, following)
        kept = terminated | ~over
    else:
        following, kept = part.next_observation, np.ones_like(over)
    columns = (part.observation, part.action, part.reward, following, terminated)
    columns = [column[kept] for column in columns]
    truncated = part.truncated[kept]
    episode = episode[kept]
    # Where the last row was dropped or not marked, the episode is cut before it.
    last = np.append(episode[1:] != episode[:-1], True)[: len(episode)]
    return *columns, truncated | (last & ~columns[-1]), episode


def _check_sizes(parts: Sequence[Part]) -> None:
    for part in parts:
        for name in ("observation", "action"):
            found, expected = (getattr(p, name).shape[1] for p in (part, parts[0]))
            if found != expected:
                raise ValueError(
                    f"{name} has {found} components in {part.row(0)}, but {expected} in "
                    f"{parts[0].row(0)}: give data of one world."
                )


def _seen(parts: Sequence[Part]) -> Bounds:
    """The least and greatest action.

    Raises:
        ValueError: A component that never changes has no range.
    """
    low = np.min([part.action.min(axis=0) for part in parts], axis=0)
    high = np.max([part.action.max(axis=0) for part in parts], axis=0)
    bounds = Bounds(tuple(map(float, low)), tuple(map(float, high)))
    constant = np.flatnonzero(low == high)
    if constant.size:
        raise ValueError(
            f"Action component {constant[0]} is {low[constant[0]]:g} in every row and no bounds "
            "are given: nothing can be learnt about it unless it varies."
        )
    warnings.warn(
        "The data do not say which actions are legal: the least and greatest in them, "
        f"{text(bounds.low)} and {text(bounds.high)}, are taken for the bounds.",
        stacklevel=4,
    )
    return bounds


def check_inside(part: Part, bounds: Bounds) -> None:
    """Refuses bounds that are no box of these actions, and actions outside it.

    Raises:
        ValueError: Names the row, the component and the bounds.
    """
    size = part.action.shape[1]
    if not len(bounds.low) == len(bounds.high) == size:
        raise ValueError(
            f"The bounds are for {len(bounds.low)} action components, but there are {size} in "
            f"{part.row(0)}: give a low and a high end for each."
        )
    if not all(low < high for low, high in zip(*bounds)):
        raise ValueError(
            f"The bounds {text(bounds.low)} and {text(bounds.high)} are no box: give low < high "
            "for each action component, -inf and inf where there is no bound."
        )
    low, high, half = (np.asarray(x) for x in (*bounds, bounds.half_range))
    outside = (part.action < low - ROUNDING * half) | (part.action > high + ROUNDING * half)
    wrong = np.argwhere(outside)
    if wrong.size:
        row, i = map(int, wrong[0])
        raise ValueError(
            f"Action component {i} is {part.action[row, i]:g} in {part.row(row)}, outside its "
            f"bounds {bounds.low[i]:g} and {bounds.high[i]:g}: log actions as they were carried "
            "out, or give the right bounds."
        )


def text(numbers: Sequence[float]) -> str:
    """Bounds in brackets, as short as can be."""
    return f"[{', '.join(f'{x:g}' if math.isfinite(x) else str(x) for x in numbers)}]"
