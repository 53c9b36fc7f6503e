"""Whether a row's successor is the one that follows: what tells order is looked at."""

import warnings

import numpy as np

from detpg.integrations.logged.clocks import Clock
from detpg.integrations.logged.parts import Part, ends

NEAR, GAP = 0.2, 1.5  # of the usual step: how far a usual one may be off, and what is none
CLOSE = 1e-4  # of a component's deviation: what rounding may do to the same observation


def in_order(part: Part) -> Part:
    """The part, cut where rows are missing.

    Raises:
        ValueError: Rows that are not in the order of time, or whose episodes take turns.
    """
    within = ~ends(part)[:-1]
    if part.next_observation is not None:  # rows are complete: any order will do
        _check_complete(part, part.next_observation, within)
        return part
    check_labels(part)
    _check_falls(part, within & _falls(part))
    stays = within & ~np.any([_moves(clock) > 0 for clock in part.clocks], axis=0)
    if part.clocks and stays.any():
        _refuse_repeats(part, stays)
    return _cut(part, within)


def _moves(clock: Clock) -> np.ndarray:
    """From each row to the next, in the clock's unit; integers are compared before they round."""
    one, two = clock.values[:-1], clock.values[1:]
    return np.where(two >= one, 1.0, -1.0) * np.where(two >= one, two - one, one - two)


def _falls(part: Part) -> np.ndarray:
    """Whether a clock falls from a row to the next; the time of day does where the date rises."""
    rises = [_moves(clock) > 0 for clock in part.clocks if clock.is_date]
    new_day = np.any(rises, axis=0)
    return np.any([(_moves(c) < 0) & (c.is_date | ~new_day) for c in part.clocks], axis=0)


def _check_falls(part: Part, falls: np.ndarray) -> None:
    if not falls.any():
        return
    i = int(np.argmax(falls))
    clock = next(clock for clock in part.clocks if _moves(clock)[i] < 0)
    raise ValueError(
        f"{clock.name} falls from {clock.say(i)} to {clock.say(i + 1)} in {part.row(i + 1)}, "
        f"inside an episode{_first_of(falls)}, and rows must be in the order of time: sort them by "
        f"episode and then by {clock.name}; where it starts again, give a column episode or mark "
        "the row before in truncated; leave the column out if it tells no order."
    )


def _refuse_repeats(part: Part, stays: np.ndarray) -> None:
    i, clock = int(np.argmax(stays)), part.clocks[0]
    raise ValueError(
        f"{clock.name} is {clock.say(i + 1)} in {part.row(i + 1)} and in the row before, inside an "
        f"episode{_first_of(stays)}: log each step once; sort rows of several plants by a column "
        f"episode and then by {clock.name}; or leave the column out if it is too coarse to tell "
        "order."
    )


def _cut(part: Part, within: np.ndarray) -> Part:
    """The part with an end before each gap in time."""
    for clock in part.clocks:
        coarse = np.any(within & (_moves(clock) == 0)) and not clock.is_date
        if not coarse:
            within = within & ~_cut_before(part, clock, within)
    truncated = part.truncated.copy()
    truncated[:-1] |= ~within & ~ends(part)[:-1]
    return part._replace(truncated=truncated)


def _cut_before(part: Part, clock: Clock, within: np.ndarray) -> np.ndarray:
    """Where a clock jumps that else goes on by one step."""
    moves = _moves(clock)
    usual = _usual(moves[within & (moves > 0)])
    jumps = within & (moves > GAP * usual)
    if jumps.any():
        i = int(np.argmax(jumps))
        warnings.warn(
            f"{clock.name} jumps from {clock.say(i)} to {clock.say(i + 1)} in {part.row(i + 1)}, "
            f"{moves[i] / usual:.3g} times the usual step{_first_of(jumps)}: rows are missing, so "
            "the episode is cut there; leave the column out if the row is the next step all the "
            "same.",
            stacklevel=6,
        )
    return jumps


def _usual(moves: np.ndarray) -> float:
    """The step by which most rows are apart; infinite if there is none."""
    if not moves.size:
        return np.inf
    step = float(np.quantile(moves, 0.25, method="lower"))
    near = np.abs(moves - step) <= NEAR * step
    return step if near.sum() >= max(2, moves.size / 2) else np.inf


def check_labels(part: Part) -> None:
    """Refuses an episode that goes on after rows of another one.

    Raises:
        ValueError: Names the episode, its rows, and what to do.
    """
    if part.episode is None:
        return
    label, last = part.episode, np.append(part.episode[1:] != part.episode[:-1], True)
    open_at: dict[object, int] = {}
    begins = np.append(0, np.flatnonzero(last)[:-1] + 1)
    for begin, end in zip(begins.tolist(), np.flatnonzero(last).tolist()):
        before = open_at.get(label[begin])
        if before is not None:
            raise ValueError(
                f"Episode {label[begin]} goes on in {part.row(begin)} after rows of another one, "
                f"though nothing ends it in {part.row(before)}: sort the rows by episode and then "
                "by time."
            )
        if not (part.terminated[end] or part.truncated[end]):
            open_at[label[begin]] = end


def _check_complete(part: Part, following: np.ndarray, within: np.ndarray) -> None:
    """Tells where a row's next observation is not that of the next row.

    Raises:
        ValueError: It is, but time runs backwards.
    """
    size = np.std(part.observation, axis=0, dtype=float)
    apart = np.abs(following[:-1] - part.observation[1:])
    same = np.all(apart <= CLOSE * (size + CLOSE * np.abs(following[:-1])), axis=1)
    falls = within & _falls(part)
    if falls.any() and same[falls].mean() > 0.5:
        _check_falls(part, falls)
    next_step = within & _succeeds(part, within, bool(falls.any()))
    wrong = next_step & ~same
    if wrong.any():
        i = int(np.argmax(wrong))
        warnings.warn(
            f"next_observation is {following[i].tolist()} in {part.row(i)}, but the next row of "
            f"the episode has the observation {part.observation[i + 1].tolist()} ({wrong.sum()} of "
            f"{next_step.sum()} rows): it is taken, which is right for complete steps in any "
            "order (mark each in truncated); else correct it, or leave the column out.",
            stacklevel=5,
        )


def _succeeds(part: Part, within: np.ndarray, mixed: bool) -> np.ndarray:
    """Whether the clocks say that a row is the next step; without any it may be."""
    moves = [_moves(clock) for clock in part.clocks]
    usual = [_usual(m[within & (m > 0)]) for m in moves]
    # Of rows in disorder that have no usual step nothing is known.
    ends = [0.0 if mixed and u == np.inf else GAP * u for u in usual]
    said = [(m > 0) & (m <= end) for m, end in zip(moves, ends)]
    return np.all(said, axis=0) if said else np.ones_like(within)


def _first_of(where: np.ndarray) -> str:
    count = int(where.sum())
    return f" (the first of {count})" if count > 1 else ""
