"""Layers by hand."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.networks import Network, layer_norm


def test_layer_norm_has_mean_0_and_deviation_1():
    unit = np.asarray(layer_norm(jnp.asarray([1.0, 2.0, 3.0, 10.0])))
    assert unit.mean() == pytest.approx(0.0, abs=1e-6)
    assert unit.std() == pytest.approx(1.0, rel=1e-4)


@pytest.mark.parametrize("norm", ["none", "first", "all"])
def test_layers_are_what_their_norm_says(norm):
    network = Network(2, (3, 4), 1, norm)
    parameters = network.init(jax.random.key(0))
    unit = np.asarray([0.3, -2.0])
    for i, layer in enumerate(parameters):
        unit = np.asarray(layer["weight"]) @ unit + np.asarray(layer["bias"])
        if i == 2:
            break
        if norm == "all" or (norm == "first" and i == 0):
            unit = (unit - unit.mean()) / np.sqrt(unit.var() + 1e-5)
        unit = np.tanh(unit) if norm == "first" and i == 0 else np.maximum(unit, 0)
    found = network(parameters, jnp.asarray([0.3, -2.0]))
    np.testing.assert_allclose(found, unit, rtol=1e-5)


def test_the_weights_start_within_their_width():
    network = Network(4, (100,), 2, output_width=0.01)
    hidden, output = network.init(jax.random.key(0))
    for part in hidden.values():
        assert 0.45 < float(jnp.max(jnp.abs(part))) <= 0.5
    for part in output.values():
        assert 0 < float(jnp.max(jnp.abs(part))) <= 0.001
