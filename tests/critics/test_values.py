"""State and action values: hand numbers, and derivatives that are those of the formula."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.critics import (
    LinearStateValue,
    MLPStateValue,
    QuadraticActionValue,
    QuadraticStateValue,
    td_error,
)
from detpg.features import QuadraticFeatures

OBSERVATION = jnp.asarray([2.0, 3.0])


def test_quadratic_features_are_all_products():
    assert QuadraticFeatures(2)(OBSERVATION).tolist() == [1, 2, 3, 4, 6, 9]
    assert QuadraticFeatures(2).size == 6


@pytest.mark.parametrize("value", [QuadraticStateValue(2), LinearStateValue(QuadraticFeatures(2))])
def test_a_linear_value_is_its_weights_times_its_features(value):
    v = value.init(jax.random.key(0))
    assert v.tolist() == [0.0] * 6
    v = jnp.asarray([1.0, 0.0, 2.0, 0.0, 0.5, -1.0])
    assert float(value(v, OBSERVATION)) == 1 + 6 + 3 - 9
    assert jax.grad(value)(v, OBSERVATION).tolist() == [1, 2, 3, 4, 6, 9]


def test_a_quadratic_action_value_has_every_product_of_state_and_action():
    value = QuadraticActionValue(1, 1)
    products = jax.grad(value)(jnp.zeros(6), jnp.asarray([2.0]), jnp.asarray([5.0]))
    assert products.tolist() == [1, 2, 5, 4, 10, 25]


@pytest.mark.usefixtures("x64")
def test_an_mlp_value_by_hand():
    value = MLPStateValue(2, hidden=3)
    v = value.init(jax.random.key(1))
    assert float(value(v, jnp.asarray([2.0, 3.0]))) == 0.0
    v |= {"output": jnp.asarray([1.0, -2.0, 0.5]), "constant": jnp.asarray(0.25)}
    hidden = np.tanh(np.asarray(v["weight"]) @ [2.0, 3.0])
    expected = 0.25 + hidden @ [1.0, -2.0, 0.5]
    assert float(value(v, jnp.asarray([2.0, 3.0]))) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("terminated", "expected"), [(False, 1 + 0.5 * 4 - 3), (True, 1 - 3)])
def test_a_terminal_state_is_not_bootstrapped_from(terminated: bool, expected: float):
    one, three, four = (jnp.asarray(x) for x in (1.0, 3.0, 4.0))
    found = td_error(one, jnp.asarray(0.5), jnp.asarray(terminated), four, three)
    assert float(found) == expected


def test_what_a_terminal_state_says_does_not_matter():
    one, nan = jnp.asarray(1.0), jnp.asarray(jnp.nan)
    assert float(td_error(one, one, jnp.asarray(True), nan, one)) == 0.0
