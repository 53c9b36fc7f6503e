import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.features import compatible_features, score
from detpg.policies import ConstantPolicy, GaussianParameters, IsotropicGaussian
from nonlinear import TwoLayers


def test_features_of_a_constant_policy_are_the_deviation():
    theta, action = jnp.asarray([1.0, 2.0]), jnp.asarray([1.5, 0.0])
    phi = compatible_features(ConstantPolicy(2), theta, jnp.ones(1), action)
    assert phi.tolist() == [0.5, -2.0]


@pytest.mark.usefixtures("x64")
def test_features_against_the_explicit_jacobian():
    policy = TwoLayers()
    theta = policy.init(jax.random.key(1))
    s, a = jnp.asarray([0.3, -1.0]), jnp.asarray([2.0, 0.1, -0.7])
    phi = compatible_features(policy, theta, s, a)
    jacobian = jax.jacobian(policy)(theta, s)
    deviation = np.asarray(a - policy(theta, s))
    assert phi.keys() == theta.keys()
    for name in theta:
        expected = np.tensordot(deviation, np.asarray(jacobian[name]), axes=1)
        np.testing.assert_allclose(phi[name], expected, rtol=1e-10, atol=1e-12)


def test_score_by_hand():
    policy = IsotropicGaussian(ConstantPolicy(2))
    parameters = GaussianParameters(jnp.asarray([1.0, 2.0]), y=jnp.log(jnp.asarray(4.0)))
    found = score(policy, parameters, jnp.ones(1), jnp.asarray([2.0, 0.0]))
    # deviation (1, -2), variance 4: (1, -2) / 4 and (1 + 4) / (2 * 4) - 2 / 2
    np.testing.assert_allclose(found.theta, [0.25, -0.5], rtol=1e-6)
    np.testing.assert_allclose(found.y, -0.375, rtol=1e-6)


@pytest.mark.usefixtures("x64")
def test_score_against_its_formula_with_a_nonlinear_mean():
    mean = TwoLayers()
    policy = IsotropicGaussian(mean)
    parameters = GaussianParameters(mean.init(jax.random.key(2)), y=jnp.asarray(-0.8, dtype=float))
    s, a = jnp.asarray([0.3, -1.0]), jnp.asarray([2.0, 0.1, -0.7])
    found = score(policy, parameters, s, a)
    phi = compatible_features(mean, parameters.theta, s, a)
    for name in phi:
        np.testing.assert_allclose(found.theta[name], phi[name] * np.exp(0.8), rtol=1e-10)
    squares = float(jnp.sum((a - mean(parameters.theta, s)) ** 2))
    np.testing.assert_allclose(found.y, squares * np.exp(0.8) / 2 - 3 / 2, rtol=1e-10)
