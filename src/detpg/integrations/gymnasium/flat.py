"""Gymnasium's spaces as vectors: observations to float32, actions to what a world accepts."""

import math
from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.spaces.utils import flatdim, flatten, flatten_space
from gymnasium.vector.utils import iterate

from detpg.bounds import meant
from detpg.integrations.gymnasium.returned import check_observation

# Of the largest bound, and four last bits of float32: what may be cut off an action unsaid.
SLACK = 4 * float(np.finfo(np.float32).eps)
# What is copied into float32 without becoming infinite.
FITTING = frozenset(map(np.dtype, ("f2", "f4", "u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8")))
FITTING_ACTION = "give a Box of floats, such as Box(-1.0, 1.0, (2,))"
FITTING_OBSERVATION = (
    "give a Box of numbers, or a Dict or Tuple of boxes, Discrete and MultiBinary spaces"
)


class FlatObservations:
    """Observations of one space, written into rows of float32.

    Attributes:
        space: Of one world.
        size: d.
        low: Bounds of the components; empty where none is bounded.
        high: Likewise.
    """

    def __init__(self, space: gymnasium.Space):
        """Looks at the space.

        Raises:
            ValueError: Names a space that is no vector, and what would be one.
        """
        self.space, self.size = space, _size(space)
        self.low, self.high = _bounds(space)
        self._is_box = isinstance(space, spaces.Box)
        self._shape = space.shape if isinstance(space, spaces.Box) else (self.size,)

    def rows(self, num: int) -> tuple[np.ndarray, np.ndarray]:
        """An empty array (num, d) and the same memory in the shape that `put` writes to."""
        memory = np.empty((num, *self._shape), np.float32)
        return memory if memory.ndim == 2 else memory.reshape(num, self.size), memory

    def put(self, memory: np.ndarray, i: int, observation: Any) -> None:
        """Writes one observation; what a world does to its own array later is not seen.

        Raises:
            UnusableError: It is not what its space says.
        """
        # Done at every step: what is right as it is costs a few comparisons.
        if not (
            self._is_box
            and type(observation) is np.ndarray
            and observation.shape == self._shape
            and observation.dtype in FITTING
        ):
            observation = self._single(observation)
        memory[i] = observation

    def _single(self, observation: Any) -> np.ndarray:
        """As float32; what is too large for it becomes infinite, and is told of as that."""
        check_observation(self.space, observation)
        flat: Any = observation if self._is_box else flatten(self.space, observation)
        with np.errstate(over="ignore"):
            return np.asarray(flat).astype(np.float32)

    def batch(self, space: gymnasium.Space, observations: Any, num: int) -> np.ndarray:
        """A batched space's observations as (num, d), always a copy.

        Raises:
            UnusableError: They are not what the space says.
        """
        check_observation(space, observations)
        flat, memory = self.rows(num)
        if self._is_box:
            with np.errstate(over="ignore"):
                memory[...] = observations
        else:
            for i, observation in enumerate(iterate(space, observations)):
                self.put(memory, i, observation)
        return flat


class FlatActions:
    """Vectors (num, m) in the world's own units, as arrays of its action space.

    Attributes:
        space: Of one world.
        size: m.
        low: Bounds of the components, -inf where there is none.
        high: Likewise.
    """

    def __init__(self, space: gymnasium.Space, num: int):
        """Looks at the space.

        Raises:
            ValueError: Names a space that is no box of floats with room in it, and what would fit.
        """
        self.space = box = _continuous(space)
        self.size = math.prod(box.shape)
        self.low, self.high = _numbers(box.low), _numbers(box.high)
        self._shape, self._batch_shape = (num, self.size), (num, *box.shape)
        # An infinite action is outside even where there is no bound.
        # NumPy types finfo for float classes alone; that the box is of floats was checked above.
        most = np.finfo(box.low.dtype.type).max  # pyright: ignore[reportArgumentType,reportCallIssue]
        self._low = np.maximum(np.ravel(box.low), -most)
        self._high = np.minimum(np.ravel(box.high), most)

    def legal(self, actions: Any) -> np.ndarray:
        """The actions in the space's dtype and shape, inside the box; a new array each time.

        Raises:
            ValueError: A shape that does not fit, a NaN, or an action outside the box by more than
                rounding to float32 explains.
        """
        given = np.asarray(actions, self._low.dtype)
        if given.shape != self._shape:
            raise ValueError(f"Actions have shape {given.shape}: give them as {self._shape}.")
        inside = np.minimum(np.maximum(given, self._low), self._high)
        if np.count_nonzero(inside != given):  # a NaN too
            self._check_rounding(given, inside)
        return inside.reshape(self._batch_shape)

    def _check_rounding(self, given: np.ndarray, inside: np.ndarray) -> None:
        missing = np.argwhere(np.isnan(given)).tolist()
        if missing:
            raise ValueError(
                f"Actions have {len(missing)} NaN, the first at {missing[0]}: what chose them has "
                "diverged; give finite numbers."
            )
        bounds = np.abs(np.stack([self._low, self._high]).astype(np.float64))
        slack = SLACK * np.max(bounds, axis=0, where=np.isfinite(self._ends()), initial=0.0)
        with np.errstate(invalid="ignore"):
            outside = np.argwhere(~(np.abs(given - inside) <= slack)).tolist()
        if outside:
            i, k = outside[0]
            raise ValueError(
                f"Action {given[i, k]:g} of component {k} lies outside [{self.low[k]:g}, "
                f"{self.high[k]:g}]: cap actions to the box before a step."
            )

    def _ends(self) -> np.ndarray:
        return np.stack([self.low, self.high])


def _numbers(values: Any) -> tuple[float, ...]:
    return tuple(meant(float(value)) for value in np.ravel(values))


def _continuous(space: gymnasium.Space) -> spaces.Box:
    refused = f"The action space {space} cannot be used"
    if not isinstance(space, spaces.Box):
        kind = type(space).__name__
        raise ValueError(f"{refused}, {kind} actions have no gradient: {FITTING_ACTION}.")
    if space.dtype.kind != "f":
        raise ValueError(f"{refused}, {space.dtype} is no float dtype: {FITTING_ACTION}.")
    if math.prod(space.shape) == 0:
        raise ValueError(f"{refused}, it has no component: {FITTING_ACTION}.")
    stuck = np.flatnonzero(space.low == space.high)
    if stuck.size:
        raise ValueError(
            f"{refused}, low = high in component {stuck[0]}: leave it out of the action and set it "
            "in the world."
        )
    return space


def _size(space: gymnasium.Space) -> int:
    refused = f"The observation space {space} cannot be used"
    unfit = next((part for part in _parts(space) if not _is_vector(part)), None)
    if unfit is not None:
        kind = type(unfit).__name__
        raise ValueError(f"{refused}, {kind} is no vector of fixed length: {FITTING_OBSERVATION}.")
    size = int(flatdim(space))
    if size == 0:
        raise ValueError(f"{refused}, it has no component: give a constant 1 as observation.")
    return size


def _parts(space: gymnasium.Space) -> Iterator[gymnasium.Space]:
    inside = space.spaces if isinstance(space, spaces.Dict | spaces.Tuple | spaces.OneOf) else None
    if inside is None:
        yield space
    else:
        for part in inside.values() if isinstance(inside, dict) else inside:
            yield from _parts(part)


def _is_vector(space: gymnasium.Space) -> bool:
    known = spaces.Box | spaces.Discrete | spaces.MultiBinary | spaces.MultiDiscrete
    return isinstance(space, known)


def _bounds(space: gymnasium.Space) -> tuple[tuple[float, ...], tuple[float, ...]]:
    flat = flatten_space(space)
    assert isinstance(flat, spaces.Box)
    low, high = _numbers(flat.low), _numbers(flat.high)
    return (low, high) if any(map(math.isfinite, (*low, *high))) else ((), ())
