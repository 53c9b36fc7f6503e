"""Tile coding: binary features of a bounded observation, a few of them active at a time."""

import dataclasses
import functools
import math
from collections.abc import Mapping
from typing import Any, Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from detpg.bounds import NO_BOUND, meant
from detpg.types import EnvironmentSpec, Observation

Partition = Literal["big", "small"]
PARTITIONS: tuple[Partition, ...] = ("big", "small")

# Observations are held this part of a tile inside the outermost tiles, as in RLPark.
MARGIN = 1e-4
MEND = "normalise observations, bound them in the world, or give a TileCoding low and high yourself"
# Multipliers of the hash (odd, from MurmurHash3's finaliser).
MIX = (0x85EBCA6B, 0xC2B2AE35)


@dataclasses.dataclass(frozen=True)
class TileCoding:
    """x(s) of Section 5.2: several grids laid over the observation, each shifted a little.

    In every tiling the observation falls into one tile, over all dimensions jointly; x(s) is 1 for
    those tiles and 0 elsewhere. Tile (c_0, c_1, ...) of tiling i has the index
    i N + c_0 + n_0 c_1 + n_0 n_1 c_2 + ..., N the number of tiles of a tiling; the bias comes last.

    With L the length of a dimension, n its tiles and m tilings, the shift o from one tiling to the
    next and the width of a tile are

    | partition | o | width | tiling i starts at |
    | --- | --- | --- | --- |
    | big | L / (n m - m + 1) | m o | low - i o; the last tiling ends at the upper bound |
    | small | L / ((n + 1) m - 1) | m o | low + i o; what lies outside belongs to the edge tiles |
    | a wrapped dimension | L / (n m) | L / n | low - i o, tiles counted modulo n |

    Attributes:
        low: Lower bound of each dimension.
        high: Upper bound of each dimension.
        grid: n, tiles along each dimension.
        num_tilings: m.
        partition: "big" or "small", see the table.
        wrapped: Dimensions whose ends meet, such as angles.
        jitter: r: each tiling is shifted down by a further U[0, 1) o r / 2 along each dimension.
        seed: Of the jitter.
        bias: Whether there is a feature that is always active.
        memory: Number of weights that tiles are hashed into; none: each tile has its own.
    """

    low: tuple[float, ...]
    high: tuple[float, ...]
    grid: tuple[int, ...]
    num_tilings: int = 10
    partition: Partition = "big"
    wrapped: tuple[int, ...] = ()
    jitter: float = 0.0
    seed: int = 0
    bias: bool = True
    memory: int | None = None

    def __post_init__(self):
        _check(self)

    @classmethod
    def for_environment(
        cls, spec: EnvironmentSpec, tiles: int | tuple[int, ...] = 10, **options: Any
    ) -> "TileCoding":
        """The tile coder over the bounds of an environment's observations.

        Args:
            spec: Of the environment.
            tiles: n, along each dimension, or one number for all of them.
            **options: Further attributes.

        Raises:
            ValueError: An observation without bounds, or attributes that do not fit.
        """
        low, high = spec.observation_low, spec.observation_high
        if not low:
            raise ValueError(
                f"The observations of {spec.name!r} have no bounds, so that tiles cannot cover "
                f"them: {MEND}."
            )
        open_ends = np.flatnonzero(~np.isfinite([low, high]).all(axis=0))
        if open_ends.size:
            k = open_ends[0]
            raise ValueError(
                f"Component {k} of the observations of {spec.name!r} ranges from {low[k]:g} to "
                f"{high[k]:g}, so that tiles cannot cover it (bounds of {NO_BOUND:g} or more count "
                f"as none): {MEND}."
            )
        grid = (tiles,) * len(low) if isinstance(tiles, int) else tiles
        return cls(low, high, grid, **options)

    @property
    def num_tiles(self) -> int:
        """Tiles of all tilings."""
        return self.num_tilings * math.prod(self.grid)

    @property
    def size(self) -> int:
        """Length of x(s)."""
        return (self.num_tiles if self.memory is None else self.memory) + self.bias

    @property
    def num_active(self) -> int:
        """The sum of x(s), the same for every s."""
        return self.num_tilings + self.bias

    @functools.cached_property
    def density(self) -> np.ndarray:
        """Tiles per unit of each dimension, one over the width of a tile."""
        return 1 / _shifts(self)[1]

    @functools.cached_property
    def starts(self) -> np.ndarray:
        """Where each tiling starts along each dimension, shape (tilings, dimensions)."""
        shift, _ = _shifts(self)
        sign = np.where(self._wraps | (self.partition == "big"), -1.0, 1.0)
        drawn = np.random.default_rng(self.seed).uniform(size=(self.num_tilings, shift.size))
        steps = sign * np.arange(self.num_tilings)[:, None] - self.jitter / 2 * drawn
        return np.asarray(self.low) + steps * shift

    @property
    def _wraps(self) -> np.ndarray:
        return np.isin(np.arange(len(self.grid)), self.wrapped)

    def active(self, observation: Observation) -> Int[Array, "active"]:
        """Indices of the features that are 1: one for each tiling, then the bias."""
        grid = np.asarray(self.grid)
        starts, density = (jnp.asarray(x, observation.dtype) for x in (self.starts, self.density))
        place = (observation[None, :] - starts) * density[None, :]
        inside = jnp.clip(place, MARGIN, jnp.asarray(grid - MARGIN, observation.dtype)[None, :])
        place = jnp.where(self._wraps[None, :], place, inside)
        tile = jnp.floor(place).astype(jnp.int32) % grid.astype(np.int32)[None, :]
        tiling = np.arange(self.num_tilings, dtype=np.int32)
        if self.memory is None:
            strides = np.cumprod([1, *self.grid]).astype(np.int32)
            index = tiling * strides[-1] + jnp.sum(tile * strides[None, :-1], 1, np.int32)
        else:
            index = _hashed(tiling, tile, self.memory)
        if not self.bias:
            return index
        return jnp.append(index, np.int32(self.size - 1))

    def __call__(self, observation: Observation) -> Float[Array, "feat"]:
        """x(s) as a vector; tiles that share a hashed weight add up."""
        return jnp.zeros(self.size, observation.dtype).at[self.active(observation)].add(1.0)


def divided(features: TileCoding, hyper: Mapping[str, Any]) -> dict[str, Any]:
    """The same hyper-parameters, every step size (`alpha_...`) divided by the active features.

    So that a step size of 1 removes the whole error of a prediction that is linear in x(s). This is
    the only place where it is done: algorithms and kernels take step sizes as they are.
    """
    return {
        name: value / features.num_active if name.startswith("alpha_") else value
        for name, value in hyper.items()
    }


def _hashed(
    tiling: np.ndarray, tile: Int[Array, "tilings dims"], memory: int
) -> Int[Array, "tilings"]:
    # Mixed coordinate by coordinate: in many dimensions the index itself has no 32-bit number.
    code = jnp.asarray(tiling, np.uint32)
    for k in range(tile.shape[1]):
        code = code * np.uint32(MIX[0]) + tile[:, k].astype(np.uint32) + np.uint32(1)
        code = (code ^ (code >> np.uint32(15))) * np.uint32(MIX[1])
        code = code ^ (code >> np.uint32(13))
    return (code % np.uint32(memory)).astype(np.int32)


def _shifts(coding: TileCoding) -> tuple[np.ndarray, np.ndarray]:
    """The shift o and the width of a tile, along each dimension."""
    length = np.subtract(coding.high, coding.low)
    n, m = np.asarray(coding.grid), coding.num_tilings
    parts = n * m - m + 1 if coding.partition == "big" else (n + 1) * m - 1
    shift = length / np.where(coding._wraps, n * m, parts)
    return shift, m * shift


def _check(coding: TileCoding) -> None:
    """Refuses, in one sentence, what is no tile coder."""
    low, high, grid = coding.low, coding.high, coding.grid
    if not (len(low) == len(high) == len(grid) >= 1):
        raise ValueError(
            f"low, high and grid have {len(low)}, {len(high)} and {len(grid)} entries: "
            "give one for each dimension of the observation."
        )
    if not all(-math.inf < meant(a) < meant(b) < math.inf for a, b in zip(low, high)):
        raise ValueError(
            f"The bounds {low} and {high} cannot be covered by tiles: "
            f"give numbers below {NO_BOUND:g}, low < high in every dimension."
        )
    counts = (*grid, coding.num_tilings)
    if not all(isinstance(n, int | np.integer) and n >= 1 for n in counts):
        raise ValueError(
            f"grid {grid} with {coding.num_tilings} tilings is not usable: give whole numbers, at "
            "least one tile and one tiling."
        )
    if coding.partition not in PARTITIONS:
        raise ValueError(
            f"partition {coding.partition!r} is unknown: choose one of {', '.join(PARTITIONS)}."
        )
    if not set(coding.wrapped) <= set(range(len(grid))):
        raise ValueError(f"wrapped {coding.wrapped} names a dimension beyond {len(grid) - 1}.")
    if not 0 <= coding.jitter <= 1:
        raise ValueError(f"jitter = {coding.jitter:g} is not usable: give a number from 0 to 1.")
    if coding.memory is None and coding.num_tiles >= 2**31:
        raise ValueError(f"{coding.num_tiles} tiles have no 32-bit index: give a memory size.")
    if coding.memory is not None and not 1 <= coding.memory < 2**31:
        raise ValueError(f"memory = {coding.memory} is not usable: give 1 to 2^31 - 1 weights.")
