"""Means and deviations of what was seen: in any unit, and of very many values."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.wrappers import Moments

UNITS = np.asarray([1e-30, 1e-12, 1e-7, 1e-3, 1.0, 1e3, 1e7, 1e12, 1e30])


@jax.jit
def added(moments, values):
    """With many more values, in the order of the first axis."""
    return jax.lax.scan(lambda seen, value: (seen.add(value), None), moments, values)[0]


def test_moments_are_those_of_numpy(x64):
    values = np.random.default_rng(0).normal(5, 3, (50, 2))
    moments = added(Moments.none((2,)), jnp.asarray(values))
    np.testing.assert_allclose(moments.mean, values.mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(moments.deviation, values.std(axis=0), rtol=1e-8)


@pytest.mark.parametrize("count", [2**24, 50_000_000, 2**31 - 2, 5_000_000_000])
def test_it_counts_on_after_very_many_values(count):
    """Of N(1, 2) after that many: the moments move as those of double precision do."""
    values = np.random.default_rng(0).normal(1, 2, 100_000).astype(np.float32)
    found = added(Moments.of(count, jnp.asarray(1.5), jnp.asarray(2.5)), jnp.asarray(values))
    num, known, fades = len(values), min(count, 2**31 - 1), count >= 2**31 - 1
    share = 1 - (1 - 1 / known) ** num if fades else num / (known + num)
    mean, second = (1 - share) * 1.5, (1 - share) * (2.5**2 + 1.5**2)
    doubles = values.astype(float)
    mean, second = mean + share * doubles.mean(), second + share * np.mean(doubles**2)
    moved = np.asarray([mean - 1.5, np.sqrt(second - mean**2) - 2.5])
    exact = [float(part.value) + float(part.rest) for part in (found.centre, found.spread)]
    np.testing.assert_allclose(np.asarray(exact) - [1.5, 2.5], moved, rtol=1e-2)
    np.testing.assert_allclose(found.deviation, 2.5 + moved[1], rtol=1e-7)


def test_what_was_right_stays_right():
    values = np.random.default_rng(1).normal(0, 2, 100_000).astype(np.float32)
    found = added(Moments.of(50_000_000, jnp.asarray(0.0), jnp.asarray(2.0)), jnp.asarray(values))
    np.testing.assert_allclose(found.deviation, 2.0, rtol=1e-4)
    np.testing.assert_allclose(found.mean, 0.0, atol=1e-4)


def test_units_do_not_matter():
    """The same numbers in units of 1e-30 to 1e30, on an offset of their own size."""
    values = np.random.default_rng(2).normal(3, 1, (200, 1)) * UNITS
    found = added(Moments.none(UNITS.shape), jnp.asarray(values, jnp.float32))
    np.testing.assert_allclose(found.mean / UNITS, np.mean(values[:, 4]), rtol=1e-5)
    np.testing.assert_allclose(found.deviation / UNITS, np.std(values[:, 4]), rtol=1e-5)


@pytest.mark.parametrize("constant", [0.0, 0.1, -273.15, 1e-30, 1e30, 1.7e9])
def test_what_never_changes_counts_0(constant):
    value = jnp.asarray(constant, jnp.float32)
    found = added(Moments.none(()), jnp.full(100, value))
    assert float((value - found.mean) / found.deviation) == 0.0
    assert np.isfinite(float((value + 1 - found.mean) / found.deviation))
