"""The tiles of compiled loops are those of `TileCoding`."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.features import TileCoding
from detpg.kernels import active_features

PLAIN = TileCoding((-1.0, 0.0), (1.0, 5.0), (10, 7), num_tilings=8)


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize(
    "change",
    [
        {},
        {"bias": False},
        {"partition": "small"},
        {"wrapped": (0,)},
        {"wrapped": (0, 1), "jitter": 0.3},
        {"jitter": 1.0, "seed": 3},
        {"memory": 97},
        {"memory": 1000, "wrapped": (1,), "bias": False},
        {"low": (-1.0,), "high": (1.0,), "grid": (4,)},
        {"low": (0.0,) * 6, "high": (1.0,) * 6, "grid": (12,) * 6, "memory": 4096},
    ],
)
def test_active_features(change):
    coding = dataclasses.replace(PLAIN, **change)
    low, high = np.array(coding.low), np.array(coding.high)
    # a fifth of the observations lies outside
    places = np.random.default_rng(0).uniform(-0.1, 1.1, (3000, low.size))
    observations = low + (high - low) * places
    found = active_features(coding, observations)
    expected = jax.vmap(coding.active)(jnp.asarray(observations))
    np.testing.assert_array_equal(found, expected)


def test_what_is_no_number_has_tiles():
    """A learner that diverges must not reach beyond its memory before it is stopped."""
    found = active_features(PLAIN, np.array([[np.nan, np.inf], [-np.inf, np.nan]]))
    assert found.max() < PLAIN.size
