import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.actors import compatible_direction, gaussian_score, likelihood_ratio_direction
from detpg.features import QuadraticFeatures
from detpg.policies import ConstantPolicy, FeatureGaussian, MeanAndWidth
from nonlinear import TwoLayers


class Gain:
    """mu_theta(s) = diag(2, 3) theta s_0: a Jacobian to multiply by hand."""

    def init(self, key):
        return jnp.zeros(2)

    def __call__(self, theta, observation):
        return jnp.asarray([2.0, 3.0]) * theta * observation[0]


def test_compatible_direction_by_hand():
    w = jnp.asarray([1.0, -1.0])
    # J = diag(2, 3) * 10; J J^T w = 100 * (4 * 1, 9 * -1)
    direction = compatible_direction(Gain(), jnp.asarray([5.0, 7.0]), jnp.asarray([10.0]), w)
    assert direction.tolist() == [400.0, -900.0]


def test_a_constant_policy_moves_along_w():
    w = jnp.asarray([0.5, -2.0])
    assert compatible_direction(ConstantPolicy(2), jnp.ones(2), jnp.ones(1), w).tolist() == [
        0.5,
        -2,
    ]


@pytest.mark.usefixtures("x64")
def test_compatible_direction_against_the_explicit_jacobian():
    policy = TwoLayers()
    theta, w = policy.init(jax.random.key(1)), policy.init(jax.random.key(2))
    s = jnp.asarray([0.3, -1.0])
    J = {name: np.asarray(j) for name, j in jax.jacobian(policy)(theta, s).items()}
    slope = sum(np.tensordot(J[name], np.asarray(w[name]), w[name].ndim) for name in J)
    direction = compatible_direction(policy, theta, s, w)
    assert direction.keys() == theta.keys()
    for name in J:
        expected = np.tensordot(slope, J[name], axes=1)
        np.testing.assert_allclose(direction[name], expected, rtol=1e-10, atol=1e-12)


def test_likelihood_ratio_by_hand():
    score = {"theta": jnp.asarray([0.25, -0.5]), "y": jnp.asarray(-0.375)}
    direction = likelihood_ratio_direction(score, jnp.asarray(-4.0))
    assert direction["theta"].tolist() == [-1.0, 2.0]
    assert float(direction["y"]) == 1.5


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("gradient", ["plain", "scaled"])
def test_the_score_of_a_gaussian_on_features_is_the_derivative_of_its_log_density(gradient):
    policy = FeatureGaussian(QuadraticFeatures(2), 2, jnp.asarray(0.7))
    keys = jax.random.split(jax.random.key(3))
    u = MeanAndWidth(*(0.3 * jax.random.normal(key, (2, 6), dtype=float) for key in keys))
    s, a = jnp.asarray([0.3, -1.0]), jnp.asarray([2.0, 0.1])
    sigma, x = policy.sigma(u, s), QuadraticFeatures(2)(s)
    found = MeanAndWidth(*gaussian_score(x, a - policy(u, s), sigma, gradient))
    expected = jax.grad(policy.log_prob)(u, s, a)
    unit = sigma[:, None] ** 2 if gradient == "scaled" else jnp.ones((2, 1))
    np.testing.assert_allclose(found.mean, unit * expected.mean, rtol=1e-12)
    # the least width 1e-7 is not part of exp(u x), so that its derivative is smaller by that much
    np.testing.assert_allclose(found.width, unit * expected.width, rtol=1e-6)


def test_samples_of_a_gaussian_on_features_have_its_mean_and_widths():
    policy = FeatureGaussian(QuadraticFeatures(1), 2, jnp.asarray(0.5))
    width = jnp.asarray([[0.0, 0.0, 0.0], [np.log(2.0), 0.0, 0.0]])
    u = MeanAndWidth(mean=jnp.asarray([[1.0, 2.0, 0.0], [0.0, 0.0, -1.0]]), width=width)
    s, num_samples = jnp.asarray([3.0]), 20_000
    keys = jax.random.split(jax.random.key(4), num_samples)
    actions = np.asarray(jax.vmap(lambda k: policy.sample(k, u, s))(keys), dtype=np.float64)
    unit = (actions - [7.0, -9.0]) / [0.5, 1.0]
    error = 4.5 / np.sqrt(num_samples)
    assert np.all(np.abs(unit.mean(axis=0)) < error)
    assert np.all(np.abs((unit**2).mean(axis=0) - 1) < np.sqrt(2) * error)
