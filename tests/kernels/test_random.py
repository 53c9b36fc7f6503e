"""The generator against its published numbers, the draws against their distributions."""

import math

import numpy as np
import pytest
import scipy.stats
from numba import njit

from detpg.kernels.random import TAIL, bits, normal, streams, uniform


@njit
def fill_bits(stream, out):
    for i in range(out.size):
        out[i] = bits(stream)


@njit
def fill_uniform(stream, out):
    for i in range(out.size):
        out[i] = uniform(stream)


@njit
def fill_normal(stream, out):
    for i in range(out.size):
        out[i] = normal(stream)


def drawn(fill, number):
    out = np.zeros(number)
    fill(streams(0, [0], [0])[0, 0, 0], out)
    return out


def test_the_first_words_from_a_known_state():
    """The test vector of the Rust crate rand_xoshiro, made with the authors' C code."""
    out = np.zeros(10, np.uint64)
    fill_bits(np.array([1, 2, 3, 4], np.uint64), out)
    assert out.tolist() == [
        41943041,
        58720359,
        3588806011781223,
        3591011842654386,
        9228616714210784205,
        9973669472204895162,
        14011001112246962877,
        12406186145184390807,
        15849039046786891736,
        10450023813501588000,
    ]


def test_uniform_draws():
    found = drawn(fill_uniform, 200_000)
    assert 0 <= found.min() < found.max() < 1
    assert scipy.stats.kstest(found, "uniform").pvalue > 1e-4


def test_normal_draws():
    found = drawn(fill_normal, 1_000_000)
    assert scipy.stats.kstest(found, "norm").pvalue > 1e-4
    assert abs(np.corrcoef(found[1:], found[:-1])[0, 1]) < 4.5 / math.sqrt(found.size)


def test_the_tail_of_the_normal_draws():
    """What lies beyond the layers is drawn by another formula."""
    number = 4_000_000
    found = drawn(fill_normal, number)
    for side in (1, -1):
        beyond = side * found[side * found > TAIL]
        expected = number * scipy.stats.norm.sf(TAIL)
        assert abs(beyond.size - expected) < 4.5 * math.sqrt(expected)
        tail = scipy.stats.truncnorm(TAIL, np.inf)
        assert scipy.stats.kstest(beyond, tail.cdf).pvalue > 1e-4


def test_a_stream_belongs_to_its_point_and_run_alone():
    whole = streams(7, range(3), range(4))
    assert np.array_equal(streams(7, [2], [1, 3]), whole[2:, 1::2])
    words = np.concatenate([whole.ravel(), streams(8, range(3), range(4)).ravel()])
    assert len(np.unique(words)) == words.size


@pytest.mark.parametrize("kinds", [(0, 1)])
def test_evaluation_has_a_stream_of_its_own(kinds):
    both = [drawn_from(streams(0, [0], [0])[0, 0, kind]) for kind in kinds]
    assert not np.any(both[0] == both[1])


def drawn_from(stream):
    out = np.zeros(100)
    fill_uniform(stream, out)
    return out
