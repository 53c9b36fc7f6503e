"""Active tiles of an observation: the same as `TileCoding.active`, for compiled loops."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from detpg.features.tile_coding import MARGIN, MIX, TileCoding
from detpg.kernels.compiling import piece


class Tiles(NamedTuple):
    """What a tile coder amounts to: dimensions first, so that tilings are contiguous."""

    starts: np.ndarray
    density: np.ndarray
    grid: np.ndarray
    strides: np.ndarray
    wrapped: np.ndarray
    first: np.ndarray
    memory: int
    bias: int


def tables(coding: TileCoding) -> Tiles:
    """The tables of a tile coder."""
    tilings, dims = coding.starts.shape
    strides = np.cumprod([1, *coding.grid])
    return Tiles(
        starts=np.ascontiguousarray(coding.starts.T),
        density=coding.density,
        grid=np.asarray(coding.grid, np.int64),
        strides=np.asarray(strides[:-1], np.int64),
        wrapped=np.isin(np.arange(dims), coding.wrapped),
        first=np.arange(tilings) * (strides[-1] if coding.memory is None else 1),
        memory=0 if coding.memory is None else coding.memory,
        bias=coding.size - 1 if coding.bias else -1,
    )


@piece
def activate(tiles, observation, active):
    """Writes the indices of the features that are 1 (unsigned: no index counts from the end)."""
    starts, density, grid, strides, wrapped, first, memory, bias = tiles
    tilings = first.size
    for i in range(tilings):
        active[i] = first[i]
    for k in range(observation.size):
        n = grid[k]
        if wrapped[k] or memory > 0:
            for i in range(tilings):
                c = _tile((observation[k] - starts[k, i]) * density[k], n, wrapped[k])
                if memory > 0:
                    active[i] = _mixed(active[i], np.uint32(c))
                else:
                    active[i] += np.uint32(c * strides[k])
        else:
            for i in range(tilings):
                place = (observation[k] - starts[k, i]) * density[k]
                # Written so that what is no number counts as the lower end.
                place = place if place > MARGIN else MARGIN
                place = place if place < n - MARGIN else n - MARGIN
                active[i] += np.uint32(np.int32(place) * np.int32(strides[k]))
    if memory > 0:
        for i in range(tilings):
            active[i] = active[i] % np.uint32(memory)
    if bias >= 0:
        active[tilings] = np.uint32(bias)


@piece
def _tile(place, n, wrapped):
    if wrapped:
        return np.int64(math.floor(place)) % n
    place = place if place > MARGIN else MARGIN
    return np.int64(place if place < n - MARGIN else n - MARGIN)


@piece
def _mixed(code, c):
    code = np.uint32(code * np.uint32(MIX[0]) + c + np.uint32(1))
    code = np.uint32((code ^ (code >> np.uint32(15))) * np.uint32(MIX[1]))
    return np.uint32(code ^ (code >> np.uint32(13)))


@njit(cache=True)
def active_of(tiles, observations, active):
    """Fills one row of active indices for each observation."""
    for t in range(len(observations)):
        activate(tiles, observations[t], active[t])
