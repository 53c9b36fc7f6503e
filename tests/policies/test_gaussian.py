import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats

from detpg.policies import (
    ConstantPolicy,
    GaussianBehaviour,
    GaussianParameters,
    IsotropicGaussian,
)

OBSERVATION = jnp.ones(1)
NUM_SAMPLES = 20_000


def oracle(action, mean, variance):
    cov = variance * np.eye(len(mean))
    return scipy.stats.multivariate_normal(mean, cov).logpdf(np.asarray(action))


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("variance", [1.0, 0.01, 7.0])
def test_the_density_is_that_of_scipy(variance):
    mean, action = jnp.asarray([1.0, -2.0, 0.5]), jnp.asarray([0.9, -2.3, 0.6])
    expected = oracle(action, mean, variance)

    policy = IsotropicGaussian(ConstantPolicy(3))
    parameters = GaussianParameters(theta=mean, y=jnp.log(jnp.asarray(variance, dtype=float)))
    found = policy.log_prob(parameters, jnp.ones(1), action)
    np.testing.assert_allclose(found, expected, rtol=1e-12)

    sigma = jnp.sqrt(jnp.asarray(variance, dtype=float))
    behaviour = GaussianBehaviour(ConstantPolicy(3), sigma)
    found = behaviour.log_prob(mean, jnp.ones(1), action)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def samples_of(kind, mean, sigma):
    keys = jax.random.split(jax.random.key(5), NUM_SAMPLES)
    if kind == "policy":
        policy = IsotropicGaussian(ConstantPolicy(2))
        parameters = GaussianParameters(theta=mean, y=2 * jnp.log(sigma))
        return jax.vmap(lambda k: policy.sample(k, parameters, OBSERVATION))(keys)
    behaviour = GaussianBehaviour(ConstantPolicy(2), sigma)
    return jax.vmap(lambda k: behaviour.act(k, mean, OBSERVATION))(keys)


@pytest.mark.parametrize("kind", ["policy", "behaviour"])
def test_samples_have_the_moments_of_the_density(kind):
    mean, sigma = jnp.asarray([1.0, -2.0]), jnp.asarray(0.3)
    actions = np.asarray(samples_of(kind, mean, sigma), dtype=np.float64)
    error = 4.5 / np.sqrt(NUM_SAMPLES)  # in standard errors of a mean of unit variance
    assert np.all(np.abs(actions.mean(axis=0) - mean) < 0.3 * error)
    # the variance of a sample variance is 2 sigma^4 / n, that of a correlation 1 / n
    covariance = np.cov(actions.T) / 0.09
    assert np.all(np.abs(np.diag(covariance) - 1) < np.sqrt(2) * error)
    assert abs(covariance[0, 1]) < error


def test_the_mean_is_the_greedy_action_and_the_variance_begins_at_one():
    policy = IsotropicGaussian(ConstantPolicy(2))
    parameters = policy.init(jax.random.key(0))
    assert policy(parameters, OBSERVATION).tolist() == [0.0, 0.0]
    assert float(jnp.exp(parameters.y)) == 1.0
