"""Bias, variance and cosine of directions whose bias, variance and cosine are known."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.actors import deterministic_direction, likelihood_ratio_direction
from detpg.diagnostics import (
    PolicyGradient,
    direction_quality,
    lqr_gradient,
    rollout_directions,
)
from detpg.environments import LQR, QuadraticBandit
from detpg.features import score
from detpg.policies import ConstantPolicy, GaussianParameters, IsotropicGaussian, LinearPolicy

K = [[-0.1, -0.4]]
KEY = jax.random.key(0)
C = jnp.asarray([[2.0, 1.0], [1.0, 3.0]])


def test_by_hand():
    directions = jnp.asarray([[1.0, 0.0], [3.0, 0.0], [2.0, 3.0]])
    resamples = 20_000
    exact = PolicyGradient(jnp.asarray([1.0, 1.0]))
    found = direction_quality(directions, exact, KEY, num_resamples=resamples)
    assert found.mean.tolist() == [2, 1]
    assert found.bias.tolist() == [1, 0]
    # Deviations (-1, -1), (1, -1), (0, 2): squares 2, 2, 4.
    np.testing.assert_allclose(found.bias_error, [np.sqrt(1 / 3), 1], rtol=1e-6)
    np.testing.assert_allclose(found.variance, 4, rtol=1e-6)
    np.testing.assert_allclose(found.variance_error, np.sqrt(4 / 3 / 3), rtol=1e-6)
    # A resampled mean of 3 has variance 8/3 / 3; scale is (2 + 1) / 2, linear in the mean.
    accuracy = 4 / np.sqrt(resamples)
    assert abs(found.bias_squared - (1 - 8 / 9)) < accuracy * found.bias_squared_error
    assert abs(found.scale - 1.5) < accuracy * found.scale_error
    # Projections of the three on (1, 1) / 2: 0.5, 1.5, 2.5, variance 2/3 over them.
    assert found.scale_error == pytest.approx(np.sqrt(2 / 9), rel=accuracy)


@pytest.mark.slow
def test_a_known_bias_is_measured():
    """A critic that is off by a^T M s has a direction that is off by M times the state moment."""
    world, gain, policy = LQR(noise=0.2, start=0.7), jnp.asarray(K), LinearPolicy(2, 1)
    M = jnp.asarray([[0.8, -0.5]])

    def direction(s, a):
        def critic(action):
            return world.action_value(gain, s, action) + action @ M @ s

        return deterministic_direction(policy, gain, s, critic)

    exact = lqr_gradient(world, gain)
    sampled = rollout_directions(
        direction, policy, gain, world, jax.random.key(1), 4_000, horizon=100
    )
    found = direction_quality(sampled, exact, KEY)
    goal, bias = np.asarray(exact.gradient), np.asarray(M @ world.state_moment(gain))
    mean = goal + bias
    lengths = np.linalg.norm(mean) * np.linalg.norm(goal)
    assert np.all(np.abs(found.bias - bias) < 4 * found.bias_error)
    assert np.max(np.abs(bias) / found.bias_error) > 20
    known = {
        "bias_squared": np.sum(bias**2),
        "scale": np.sum(mean * goal) / np.sum(goal**2),
        "cosine": np.sum(mean * goal) / lengths,
    }
    for name, value in known.items():
        error = getattr(found, f"{name}_error")
        assert abs(getattr(found, name) - value) < 4 * error, name
        assert error < 0.1 * abs(value), name


def test_the_variance_of_the_deterministic_direction():
    """Of (g s) s^T over normal s: |g|^2 (2 d) - |g|^2 = 3 |g|^2 in d = 2, by Isserlis."""
    policy, gain, g = LinearPolicy(2, 1), jnp.asarray(K), jnp.asarray([[1.5, -2.0]])
    states = jax.random.normal(jax.random.key(2), (8_000, 2))

    def direction(s):
        return deterministic_direction(policy, gain, s, lambda a: a @ g @ s)

    found = direction_quality(direction, PolicyGradient(g), KEY, data=states)
    assert abs(found.variance - 3 * 6.25) < 4 * found.variance_error
    assert found.variance_error < 0.1 * found.variance
    assert np.all(np.abs(found.bias) < 4 * found.bias_error)
    assert abs(found.cosine - 1) < 4 * found.cosine_error


def test_the_likelihood_ratio_is_unbiased_and_its_variance_goes_as_sigma_to_the_minus_two():
    bandit, policy, size = QuadraticBandit(C=C), IsotropicGaussian(ConstantPolicy(2)), 4_000
    mean = jnp.asarray([5.0, 2.0])
    start, end = jnp.asarray(False), jnp.asarray(True)
    exact = PolicyGradient(-2 * C @ (mean - bandit.a_star))

    def judged(sigma, key):
        theta = GaussianParameters(mean, y=2 * jnp.log(sigma))

        def direction(key):
            s = jnp.ones(1)
            a = policy.sample(key, theta, s)
            value = bandit.reward(start, a, end)
            return likelihood_ratio_direction(score(policy, theta, s, a), value).theta

        return direction_quality(direction, exact, KEY, data=jax.random.split(key, size))

    sigmas = jnp.asarray([0.04, 0.02, 0.01, 0.005])
    found = jax.jit(jax.vmap(judged))(sigmas, jax.random.split(jax.random.key(5), 4))
    assert np.all(np.abs(found.bias) < 4 * found.bias_error)
    assert np.all(np.abs(found.scale - 1) < 4 * found.scale_error)
    # The slope of a straight line, and its standard error from those of the logarithms. At sigma
    # the variance is that of the leading term times 1 + O(sigma^2).
    at = np.log(np.asarray(sigmas))
    weights = (at - at.mean()) / np.sum((at - at.mean()) ** 2)
    slope = weights @ np.log(np.asarray(found.variance))
    error = np.sqrt(weights**2 @ np.asarray(found.variance_error / found.variance) ** 2)
    assert abs(slope + 2) < 4 * error
    assert error < 0.05


@pytest.mark.parametrize(
    ("known", "biased"), [(True, False), (False, True)], ids=["unbiased", "biased, by rollouts"]
)
def test_corrected_numbers_are_right_on_average_and_errors_are_not_too_small(known, biased):
    repeats, n, size = 150, 30, 100
    goal = jnp.ones(n) / n**0.5
    truth = goal + (0.5 * jnp.eye(n)[0] if biased else jnp.zeros(n))
    bias = truth - goal
    values = (
        jnp.dot(bias, bias),
        jnp.dot(truth, goal),
        jnp.dot(truth, goal) / jnp.linalg.norm(truth),
        jnp.asarray(0.25 * n),
    )

    def once(key):
        keys = jax.random.split(key, 3)
        sampled = truth[None, :] + 0.5 * jax.random.normal(keys[0], (size, n))
        rollouts = goal[None, :] + 0.5 * jax.random.normal(keys[1], (size, n))
        rough = PolicyGradient(jnp.mean(rollouts, axis=0), rollouts)
        exact = PolicyGradient(goal) if known else rough
        found = direction_quality(sampled, exact, keys[2], num_resamples=200)
        names = ("bias_squared", "scale", "cosine", "variance")
        return (
            jnp.stack([getattr(found, name) for name in names]),
            jnp.stack([getattr(found, f"{name}_error") for name in names]),
            found.bias,
            found.bias_error,
        )

    found, said, bias_found, bias_said = (
        np.asarray(x) for x in jax.jit(jax.vmap(once))(jax.random.split(jax.random.key(7), repeats))
    )
    spread = found.std(axis=0, ddof=1)
    error = spread / np.sqrt(repeats)
    # The correction takes out the first order of the noise: of its part t in the squared length of
    # the mean, t^2 is left, and t / size since a resampled variance is that much too small.
    t = 0.25 * n * (1 / size + (0 if known else 1 / size))
    left = np.asarray([t / size, t**2, t**2, 0])
    assert np.all(np.abs(found.mean(axis=0) - np.asarray(values)) < 4 * error + left)
    # The spread's own relative error is 1 / sqrt(2 repeats). Where the bias is 0 or the cosine 1
    # the bootstrap adds its noise to the sample's, which makes up to sqrt(3) of the spread.
    wide = 4 / np.sqrt(2 * repeats)
    ratio = said.mean(axis=0) / spread
    assert np.all(ratio > 1 - wide)
    assert np.all(ratio < np.sqrt(3) * (1 + wide))
    np.testing.assert_allclose(ratio[[1, 3]], 1, atol=wide)
    pooled = bias_said.mean(axis=0) / bias_found.std(axis=0, ddof=1)
    np.testing.assert_allclose(pooled.mean(), 1, atol=4 / np.sqrt(2 * repeats * n) + 1 / repeats)


def test_a_zero_gradient_has_no_angle_but_a_bias():
    directions = jnp.asarray([[1.0], [3.0]])
    found = direction_quality(directions, PolicyGradient(jnp.zeros(1)), KEY, num_resamples=10)
    assert found.bias.tolist() == [2]
    assert np.isnan(found.cosine)
    assert np.isnan(found.scale)
    assert np.isfinite(found.bias_squared)


def test_directions_keep_their_shape():
    tree = {"a": jnp.ones((3, 2)), "b": jnp.asarray([1.0, 2.0, 3.0])}
    found = direction_quality(
        tree, PolicyGradient({"a": jnp.zeros(2), "b": jnp.asarray(1.0)}), KEY, num_resamples=10
    )
    assert found.bias["a"].tolist() == [1, 1]
    assert float(found.bias["b"]) == 1


@pytest.mark.parametrize(
    ("directions", "data", "words"),
    [
        (jnp.ones((3, 3)), None, "do not fit the exact gradient"),
        (jnp.ones(2), None, "do not fit the exact gradient"),
        (jnp.asarray(1.0), None, "do not fit the exact gradient"),
        ({"a": jnp.ones((3, 2))}, None, "do not fit the exact gradient"),
        (jnp.ones((1, 2)), None, "give 2 or more"),
        (jnp.ones((3, 2)), jnp.ones(3), "Directions and data do not fit"),
        (jnp.ones_like, None, "Directions and data do not fit"),
    ],
)
def test_what_does_not_fit_is_refused(directions, data, words):
    with pytest.raises(ValueError, match=words):
        direction_quality(directions, PolicyGradient(jnp.ones(2)), KEY, data=data)
