"""Random numbers of one run: xoshiro256++ and a ziggurat, from a state of four 64-bit words."""

import math
from collections.abc import Sequence

import numpy as np

from detpg.kernels.compiling import piece

LAYERS = 256
# Where the tail of the normal density begins, for 256 layers of equal area (Marsaglia & Tsang).
TAIL = 3.6541528853610088
AREA = 0.00492867323399

TRAINING, EVALUATION = 0, 1


def streams(seed: int, points: Sequence[int], runs: Sequence[int]) -> np.ndarray:
    """States of the generators of each run: for training, and for evaluation.

    They depend on the study's seed and on the numbers of the point and the run, not on what else
    is run beside them or by how many threads.

    Returns:
        Shape (points, runs, 2, 4), unsigned 64-bit words.
    """
    kinds = (TRAINING, EVALUATION)
    words = [
        np.random.SeedSequence(seed, spawn_key=(point, run, kind)).generate_state(4, np.uint64)
        for point in points
        for run in runs
        for kind in kinds
    ]
    return np.array(words, np.uint64).reshape(len(points), len(runs), len(kinds), 4)


def _ziggurat() -> tuple[np.ndarray, np.ndarray]:
    """Right edges of the layers, from the widest, and the density's height (exp(-x^2/2)) there."""
    edges = np.zeros(LAYERS + 1)
    edges[1] = TAIL
    # The lowest layer holds the tail as well: as wide as a rectangle of the same area would be.
    edges[0] = AREA / np.exp(-(TAIL**2) / 2)
    for i in range(2, LAYERS):
        height = np.exp(-(edges[i - 1] ** 2) / 2) + AREA / edges[i - 1]
        edges[i] = np.sqrt(-2 * np.log(height))
    return edges, np.exp(-(edges**2) / 2)


EDGES, HEIGHTS = _ziggurat()


@piece
def _rotated(word, by):
    return (word << np.uint64(by)) | (word >> np.uint64(64 - by))


@piece
def bits(stream):
    """The next 64 bits (Blackman & Vigna, xoshiro256++)."""
    found = _rotated(stream[0] + stream[3], 23) + stream[0]
    shifted = stream[1] << np.uint64(17)
    stream[2] ^= stream[0]
    stream[3] ^= stream[1]
    stream[1] ^= stream[2]
    stream[0] ^= stream[3]
    stream[2] ^= shifted
    stream[3] = _rotated(stream[3], 45)
    return found


@piece
def uniform(stream):
    """A draw from [0, 1), 53 bits of it."""
    return (bits(stream) >> np.uint64(11)) * 2.0**-53


@piece
def normal(stream):
    """A draw from the standard normal distribution (Marsaglia & Tsang 2000; Doornik 2005)."""
    while True:
        # The layer, the sign and the place in the layer are different bits of one word.
        word = bits(stream)
        layer = word & np.uint64(255)
        sign = 1.0 if word & np.uint64(256) else -1.0
        x = (word >> np.uint64(11)) * 2.0**-53 * EDGES[layer]
        if x < EDGES[layer + np.uint64(1)]:
            return sign * x
        if layer == np.uint64(0):
            return sign * _tail(stream)
        low, high = HEIGHTS[layer], HEIGHTS[layer + np.uint64(1)]
        if low + uniform(stream) * (high - low) < math.exp(-x * x / 2):
            return sign * x


@piece
def _tail(stream):
    """A draw from beyond TAIL (Marsaglia 1964)."""
    while True:
        x = -math.log(1.0 - uniform(stream)) / TAIL
        if -2.0 * math.log(1.0 - uniform(stream)) > x * x:
            return TAIL + x
