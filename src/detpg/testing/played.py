"""A Gymnasium environment played with random actions, and all that was seen of it."""

import dataclasses
import warnings
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.spaces.utils import flatten

from detpg.bounds import Bounds
from detpg.integrations.gymnasium.returned import (
    UnusableError,
    check_observation,
    checked_reset,
    checked_step,
    seen_through,
)
from detpg.world_error import show

ROUNDING = 1e-6  # of a bound: what an observation may be beyond it


class Ended(NamedTuple):
    """How an episode ended."""

    length: int
    terminated: bool
    truncated: bool


@dataclasses.dataclass
class Play:
    """What was seen, step after step and episode after episode.

    Attributes:
        actions: As given to the environment.
        observations: All, flattened: those after a reset too.
        rewards: One for each step.
        steps: All that each step returned, comparable to the bit.
        ended: The episodes that ended.
        beyond: First observation beyond the bounds of its space, in words.
        unlike: First observation of another type than its space says, in words.
        rewritten: First step that changed an observation handed on before it.
        fault: What stopped the play, in words.
    """

    actions: list[np.ndarray] = dataclasses.field(default_factory=list)
    observations: list[np.ndarray] = dataclasses.field(default_factory=list)
    rewards: list[float] = dataclasses.field(default_factory=list)
    steps: list[tuple[Any, ...]] = dataclasses.field(default_factory=list)
    ended: list[Ended] = dataclasses.field(default_factory=list)
    beyond: str = ""
    unlike: str = ""
    rewritten: int | None = None
    fault: str = ""

    def differs(self, other: "Play") -> int | None:
        """The first step at which a shorter play differs, 0 for the reset; None if none does."""
        if self.observations[0].tobytes() != other.observations[0].tobytes():
            return 0
        pairs = zip(self.steps, other.steps)
        return next((t for t, (one, two) in enumerate(pairs, 1) if one != two), None)


def play(
    env: gymnasium.Env,
    steps: int,
    seed: int,
    action_seed: int,
    actions: list[np.ndarray] | None = None,
) -> Play:
    """Plays on through resets; an exception ends the play and is kept in words.

    Args:
        env: What is played.
        steps: How many.
        seed: Of the first reset; the others go on from it.
        action_seed: Of the actions, drawn from the action space; where a bound is none that can be
            meant, as where there is none.
        actions: What to repeat instead.
    """
    seen = Play()
    space = _drawable(env.action_space)
    space.seed(action_seed)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # `contains` warns of types; that is said in words
            _play(env, steps, seed, space if actions is None else actions, seen)
    except Exception as error:
        show(error)
        seen.fault = _fault(error, len(seen.actions))
    return seen


def _fault(error: Exception, step: int) -> str:
    where, error = f"step {step}" if step else "the reset", seen_through(error)
    if isinstance(error, UnusableError):
        return f"{where} returned what cannot be used, {str(error).rstrip('.')}"
    return f"{where} raised {type(error).__name__}: {' '.join(str(error).split())}"


def _play(
    env: gymnasium.Env, steps: int, seed: int, actions: Box | list[np.ndarray], play: Play
) -> None:
    space, length = env.observation_space, 0
    latest = checked_reset(env.reset(seed=seed))
    _look(space, latest, play)
    for t in range(steps):
        held = latest
        action = actions.sample() if isinstance(actions, Box) else actions[t]
        play.actions.append(action.copy())
        latest, reward, *ends = checked_step(env.step(action.copy()))
        length += 1
        play.rewards.append(float(reward))
        _watch(space, held, play)
        _look(space, latest, play)
        play.steps.append((play.observations[-1].tobytes(), np.float64(reward).tobytes(), *ends))
        if any(ends):
            play.ended.append(Ended(length, *ends))
            held, length = latest, 0
            latest = checked_reset(env.reset())
            _watch(space, held, play)
            _look(space, latest, play)


def _drawable(space: Any) -> Box:
    ends = Bounds(tuple(map(float, np.ravel(space.low))), tuple(map(float, np.ravel(space.high))))
    low, high = (np.reshape(end, space.shape).astype(space.dtype) for end in ends.meant)
    return Box(low, high, dtype=space.dtype)


def _watch(space: gymnasium.Space, held: Any, play: Play) -> None:
    """Whether what was handed on last is still what it was."""
    if play.rewritten is None and _flat(space, held).tobytes() != play.observations[-1].tobytes():
        play.rewritten = len(play.rewards)


def _flat(space: gymnasium.Space, observation: Any) -> np.ndarray:
    flat: Any = flatten(space, observation)
    return np.array(flat, np.float64)


def _look(space: gymnasium.Space, observation: Any, play: Play) -> None:
    """Keeps the observation, and what is wrong with it."""
    check_observation(space, observation)
    play.observations.append(_flat(space, observation))
    if space.contains(observation):
        return
    if not isinstance(space, Box):
        play.unlike = play.unlike or f"{observation} is not in {space}"
        return
    values = np.asarray(observation)
    if not np.can_cast(values.dtype, space.dtype):
        play.unlike = play.unlike or f"the dtype is {values.dtype}, not {space.dtype}"
    play.beyond = play.beyond or _beyond(space, values.astype(np.float64))


def _beyond(space: Box, values: np.ndarray) -> str:
    low, high = space.low.astype(np.float64), space.high.astype(np.float64)
    with np.errstate(invalid="ignore"):
        below, above = values < low - ROUNDING * abs(low), values > high + ROUNDING * abs(high)
    outside = [tuple(k) for k in np.argwhere(below | above).tolist()]
    if not outside:
        return ""
    k = outside[0]
    name = ", ".join(map(str, k))
    return f"component {name} is {values[k]:g}, outside [{low[k]:g}, {high[k]:g}]"
