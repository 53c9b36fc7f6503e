"""The multilayer perceptron: numbers by hand, bounds, first weights."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.policies import MLPPolicy


def sigmoid(x):
    return 1 / (1 + np.exp(-x))


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize(
    ("activation", "output", "hidden_unit", "output_unit"),
    [
        ("tanh", "linear", np.tanh, lambda x: x),
        ("sigmoid", "sigmoid", sigmoid, sigmoid),
        ("tanh", "tanh", np.tanh, np.tanh),
    ],
)
def test_two_layers_by_hand(activation, output, hidden_unit, output_unit):
    policy = MLPPolicy(2, 3, hidden=(4,), activation=activation, output=output)
    theta = jax.tree.map(lambda x: x + 0.1, policy.init(jax.random.key(1)))
    s = jnp.asarray([0.5, -1.0])
    (first, last) = (jax.tree.map(np.asarray, layer) for layer in theta)
    hidden = hidden_unit(first["weight"] @ [0.5, -1.0] + first["bias"])
    expected = output_unit(last["weight"] @ hidden + last["bias"])
    np.testing.assert_allclose(policy(theta, s), expected, rtol=1e-12)


def test_sigmoid_outputs_stay_in_the_unit_interval():
    policy = MLPPolicy(2, 3, output="sigmoid", output_width=100.0)
    actions = policy(policy.init(jax.random.key(0)), jnp.asarray([30.0, -20.0]))
    assert np.all((np.asarray(actions) >= 0) & (np.asarray(actions) <= 1))


def test_the_first_output_weights_have_their_width():
    policy = MLPPolicy(2, 100, hidden=(100,), output_width=0.5)
    *_, last = policy.init(jax.random.key(0))
    # 10,000 normal draws: the relative error of their standard deviation is 1 / sqrt(2 n)
    assert abs(float(jnp.std(last["weight"])) * 10 / 0.5 - 1) < 4.5 / np.sqrt(20_000)
