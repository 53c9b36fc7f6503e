import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.critics import linear_regression

regress = jax.jit(linear_regression)


def test_slopes_and_bias_by_hand():
    features = jnp.asarray([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])
    # 3 + 2 x - y + 5 x y: the product is orthogonal to 1, x and y, and leaves no trace.
    targets = jnp.asarray([9.0, 1.0, -5.0, 7.0])
    fit = regress(features, targets)
    np.testing.assert_allclose(fit.w, [2.0, -1.0], rtol=1e-5)
    np.testing.assert_allclose(fit.bias, 3.0, rtol=1e-5)
    np.testing.assert_allclose(fit(jnp.asarray([10.0, 1.0])), 22.0, rtol=1e-5)


def problem(sigma, dtype):
    """Rewards of a bandit far from its optimum, explored with noise of width sigma."""
    generator = np.random.default_rng(7)
    features = sigma * generator.normal(size=(20, 10)) + 3 * sigma
    targets = 5 + features @ generator.normal(size=10) + 0.1 * sigma * generator.normal(size=20)
    return features.astype(dtype), targets.astype(dtype)


def oracle(features, targets):
    design = np.column_stack([features, np.ones(len(features))]).astype(np.float64)
    solution = np.linalg.lstsq(design, targets.astype(np.float64))[0]
    return solution[:-1], solution[-1]


def assert_fits(dtype, sigma, tolerance):
    features, targets = problem(sigma, dtype)
    fit = regress(jnp.asarray(features), jnp.asarray(targets))
    w, bias = oracle(features, targets)
    assert fit.w.dtype == dtype
    np.testing.assert_allclose(fit.w, w, rtol=0, atol=tolerance * np.max(np.abs(w)))
    np.testing.assert_allclose(fit.bias, bias, rtol=tolerance)


@pytest.mark.parametrize("sigma", [1.0, 1e-3])
def test_single_precision_against_least_squares_with_a_bias_column(sigma):
    assert_fits(np.float32, sigma, tolerance=2e-4)


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("sigma", [1.0, 1e-3])
def test_double_precision_against_least_squares_with_a_bias_column(sigma):
    assert_fits(np.float64, sigma, tolerance=1e-12)


@pytest.mark.usefixtures("x64")
def test_residuals_are_orthogonal_to_every_feature_and_to_one():
    features, targets = problem(0.1, np.float64)
    fit = regress(jnp.asarray(features), jnp.asarray(targets))
    residuals = targets - np.asarray(jax.vmap(fit)(jnp.asarray(features)))
    assert np.max(np.abs(residuals)) > 1e-3
    np.testing.assert_allclose(residuals @ features, 0, atol=1e-12)
    np.testing.assert_allclose(np.sum(residuals), 0, atol=1e-12)


def test_a_feature_without_width_has_no_slope():
    features = jnp.asarray([[1.0, 4.0], [2.0, 4.0], [3.0, 4.0]])
    fit = regress(features, jnp.asarray([2.0, 4.0, 6.0]))
    np.testing.assert_allclose(fit.w, [2.0, 0.0], atol=1e-5)
    np.testing.assert_allclose(fit(features[0]), 2.0, rtol=1e-5)


def test_fewer_rows_than_features_are_interpolated():
    features = jax.random.normal(jax.random.key(0), (3, 8))
    targets = jnp.asarray([1.0, -2.0, 5.0])
    fit = regress(features, targets)
    np.testing.assert_allclose(jax.vmap(fit)(features), targets, rtol=1e-3)


def test_what_is_not_finite_stays_visible():
    features, targets = problem(1.0, np.float32)
    fit = regress(jnp.asarray(features), jnp.asarray(targets).at[3].set(jnp.inf))
    assert not bool(jnp.all(jnp.isfinite(fit.w)))
