"""What a world returns: used as it is if it is what its spaces say, else refused in words."""

import math
from collections.abc import Mapping
from typing import Any, NoReturn

import numpy as np
from gymnasium import spaces

from detpg.world_error import WorldError, sentence

REAL, WHOLE = "biuf", "biu"  # kinds of dtypes
MOST = float(np.finfo(np.float32).max)
STEP = "observation, reward, terminated, truncated and info"
OLD_API = (
    "it has the API of gym before 0.26, so change it to that of gymnasium.Env, or wrap it in "
    "shimmy.GymV21CompatibilityV0"
)
# What a wrapper of Gymnasium says where the world inside returned four values.
OLD_STEP = "not enough values to unpack (expected 5, got 4)"
# How to mend what is refused.
RIGHT = "let the world return that, or correct its observation_space"
THAT = "let the world return that"


class UnusableError(ValueError):
    """What a world returned, what was expected and how to mend it; not yet which world."""


def blame(name: str, verb: str, error: Exception, index: int | None = None) -> NoReturn:
    """Tells what was raised, or what was returned and refused here, as the world's.

    Args:
        name: Of the world.
        verb: What was asked of it: reset, step, render or close.
        error: What came.
        index: Which of several worlds.

    Raises:
        WorldError: Always.
    """
    error = seen_through(error)
    if isinstance(error, UnusableError):
        what = f"The world {name!r} returned from {verb} what cannot be used"
        raise WorldError(what, str(error), index) from None
    what = f"The world {name!r} raised {type(error).__name__} in {verb}"
    hint = ""
    if isinstance(error, TypeError) and "unexpected keyword argument 'seed'" in str(error):
        hint = f" Let reset take seed and options: {OLD_API}."
    raise WorldError(what, sentence(error) + hint, index) from error


def seen_through(error: Exception) -> Exception:
    """The error itself, or what was returned where a wrapper of Gymnasium stumbled over that."""
    return _wrong_number(4) if OLD_STEP in str(error) else error


def checked_reset(returned: Any) -> Any:
    """The observation of what a reset returned.

    Raises:
        UnusableError: It is no observation with an info.
    """
    fine = isinstance(returned, tuple | list) and len(returned) == 2
    if not fine or not isinstance(returned[1], Mapping):
        told = "an observation alone" if not fine else f"{_told(returned[1])} as info"
        raise UnusableError(f"{told} instead of observation and info: {OLD_API}.")
    return returned[0]


def checked_step(returned: Any) -> tuple[Any, float, bool, bool]:
    """Observation, reward, terminated and truncated of what a step returned.

    Raises:
        UnusableError: There are not five values, or the reward or a flag is none.
    """
    seen, reward, terminated, truncated = step_values(returned)
    # Values of these types are almost all there are: they cost no call.
    if not isinstance(reward, float | int) or not -MOST <= reward <= MOST:
        reward = _number(reward)
    if terminated is not True and terminated is not False:
        terminated = _flag("terminated", terminated)
    if truncated is not True and truncated is not False:
        truncated = _flag("truncated", truncated)
    return seen, reward, terminated, truncated


def step_values(returned: Any) -> Any:
    """The first four of five values.

    Raises:
        UnusableError: There is another number of them.
    """
    if not isinstance(returned, tuple | list):
        raise UnusableError(f"{_told(returned)} instead of {STEP}: let it return these five.")
    if len(returned) != 5:
        raise _wrong_number(len(returned))
    return returned[:4]


def checked_rewards(rewards: Any, num: int) -> np.ndarray:
    """The rewards of several copies as float32; what is too large for it is infinite."""
    expected = f"one number for each of {num} copies"
    found = _array("the reward", rewards, (num,), REAL, expected, THAT)
    with np.errstate(over="ignore"):
        return found.astype(np.float32)


def checked_flags(name: str, flags: Any, num: int) -> np.ndarray:
    """Whether the episodes of several copies ended."""
    return _array(name, flags, (num,), "b", f"True or False for each of {num} copies", THAT)


def check_observation(space: Any, seen: Any, name: str = "the observation") -> None:
    """Refuses an observation whose writing into a vector would stretch, drop or misplace numbers.

    Bounds of a box are not looked at: the normalisers take what lies outside them as it is.

    Raises:
        UnusableError: Names the part, what it was and what its space says.
    """
    if isinstance(space, spaces.Box):
        if type(seen) is not np.ndarray or seen.shape != space.shape or seen.dtype.kind not in REAL:
            _array(name, seen, space.shape, REAL, f"numbers of shape {space.shape}")
    elif isinstance(space, spaces.Discrete):
        _check_whole(name, seen, (), space.start, space.start + space.n - 1)
    elif isinstance(space, spaces.Dict):
        if not isinstance(seen, Mapping) or seen.keys() != space.spaces.keys():
            raise _unlike(name, seen, f"a dictionary of {', '.join(map(repr, space.spaces))}")
        for key, part in space.spaces.items():
            check_observation(part, seen[key], f"{name}[{key!r}]")
    elif isinstance(space, spaces.Tuple):
        if not isinstance(seen, tuple | list) or len(seen) != len(space.spaces):
            raise _unlike(name, seen, f"a tuple of {len(space.spaces)} entries")
        for i, (part, own) in enumerate(zip(space.spaces, seen)):
            check_observation(part, own, f"{name}[{i}]")
    elif isinstance(space, spaces.MultiDiscrete):
        _check_whole(name, seen, space.shape, space.start, space.start + space.nvec - 1)
    elif isinstance(space, spaces.MultiBinary):
        _check_whole(name, seen, space.shape, 0, 1)
    elif isinstance(space, spaces.OneOf):
        if not isinstance(seen, tuple | list) or len(seen) != 2:
            raise _unlike(name, seen, "the number of a space and an observation of it")
        _check_whole(f"{name}[0]", seen[0], (), 0, len(space.spaces) - 1)
        check_observation(space.spaces[int(seen[0])], seen[1], f"{name}[1]")


def _check_whole(name: str, seen: Any, shape: tuple[int, ...], low: Any, high: Any) -> None:
    """Whole numbers between two ends."""
    if shape == () and isinstance(seen, int | np.integer) and low <= seen <= high:
        return
    many = "a whole number" if shape == () else f"whole numbers of shape {shape}"
    expected = f"{many} from {np.min(low)} to {np.max(high)}"
    found = _array(name, seen, shape, WHOLE, expected)
    if not np.all((low <= found) & (found <= high)):
        raise _unlike(name, found.tolist(), expected)


def _number(reward: Any) -> float:
    found = float(_array("the reward", reward, (), REAL, "one number", THAT))
    # Beyond single precision is infinite, and told as that where the learner is lost by it.
    return math.copysign(math.inf, found) if abs(found) > MOST else found


def _flag(name: str, value: Any) -> bool:
    return bool(_array(name, value, (), "b", "True or False", THAT))


def _array(
    name: str, value: Any, shape: tuple[int, ...], kinds: str, expected: str, mend: str = RIGHT
) -> np.ndarray:
    try:
        found = np.asarray(value)
    except Exception as error:  # whatever an array of another library raises
        raise _unlike(name, value, expected, mend) from error
    if found.shape != shape or found.dtype.kind not in kinds:
        raise _unlike(name, value, expected, mend)
    return found


def _unlike(name: str, value: Any, expected: str, mend: str = RIGHT) -> UnusableError:
    return UnusableError(f"{name} was {_told(value)} instead of {expected}: {mend}.")


def _wrong_number(num: int) -> UnusableError:
    mend = OLD_API if num == 4 else "let it return these five"
    return UnusableError(f"{num} values instead of {STEP}: {mend}.")


def _told(value: Any) -> str:
    """A value in words, however large it is."""
    if hasattr(value, "shape") and hasattr(value, "dtype") and np.shape(value) != ():
        return f"an array of shape {tuple(value.shape)} and dtype {value.dtype}"
    words = " ".join(repr(value).split())
    words = words if len(words) <= 60 else f"{words[:57]}..."
    return words if value is None else f"{words} ({type(value).__name__})"
