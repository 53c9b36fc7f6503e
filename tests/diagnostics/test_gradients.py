"""Differentiation through rollouts against closed forms."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.actors import deterministic_direction
from detpg.diagnostics import PolicyGradient, lqr_gradient, rollout_directions, rollout_gradient
from detpg.environments import LQR, QuadraticBandit
from detpg.policies import ConstantPolicy, GaussianParameters, IsotropicGaussian, LinearPolicy
from toys import Chain

K = [[-0.1, -0.4]]
POLICY = LinearPolicy(2, 1)
KEY = jax.random.key(0)


class FromHere(LQR):
    """Starts where it is told, undisturbed."""

    def initial(self, key):
        return jnp.asarray([1.0, -2.0])[: len(self.A)]


class Echo(Chain):
    """Earns the action; past its end nothing is a number."""

    def reward(self, state, action, next_state):
        past = state.position >= self.length
        return jnp.where(past, jnp.nan, 1.0) * action[0] ** 2


class Stairs(Chain):
    """Earns the action rounded: a derivative of zero."""

    def reward(self, state, action, next_state):
        return jnp.round(action[0])


@pytest.mark.usefixtures("x64")
def test_an_undisturbed_rollout_has_the_closed_forms_gradient():
    """The horizon leaves out 0.9^300 = 2e-14 of the value, less than the tolerance."""
    world, gain = FromHere(noise=0.0, gamma=0.9), jnp.asarray(K)
    found = rollout_gradient(POLICY, gain, world, KEY, 2, horizon=300)
    exact = jax.grad(world.value)(gain, world.initial(KEY))
    np.testing.assert_allclose(found.gradient, exact, rtol=1e-11)
    np.testing.assert_allclose(found.error, 0.0, atol=1e-11)


@pytest.mark.usefixtures("x64")
def test_a_short_horizon_has_the_gradient_of_its_own_sum():
    """With one state and f = A + B k: J_T = -(Q + k^2 R) s^2 (1 - x^T) / (1 - x), x = gamma f^2."""
    world = FromHere([[0.9]], [[0.5]], [[2.0]], [[0.3]], noise=0.0)
    gain = jnp.asarray([[-0.4]])
    for T in (1, 2, 7):

        def J(k, T=T):
            x = world.gamma * (0.9 + 0.5 * k) ** 2
            return -(2.0 + 0.3 * k**2) * (1 - x**T) / (1 - x)

        found = rollout_gradient(LinearPolicy(1, 1), gain, world, KEY, 2, horizon=T)
        np.testing.assert_allclose(found.gradient[0, 0], jax.grad(J)(gain[0, 0]), rtol=1e-12)


def test_the_mean_of_rollouts_is_the_closed_form():
    world, gain = LQR(noise=0.2, start=0.7), jnp.asarray(K)
    found = rollout_gradient(POLICY, gain, world, jax.random.key(1), 4_000, horizon=100)
    exact = lqr_gradient(world, gain)
    assert np.all(np.abs(found.gradient - exact.gradient) < 4 * found.error)
    assert np.all(found.error < 0.05 * np.max(np.abs(exact.gradient)))
    np.testing.assert_array_equal(exact.error, 0.0)


def test_a_stochastic_policy_is_differentiated_through_its_noise():
    """J = -(theta - a*)^T C (theta - a*) - exp(y) tr C."""
    C = jnp.asarray([[2.0, 1.0], [1.0, 3.0]])
    bandit, policy = QuadraticBandit(C=C), IsotropicGaussian(ConstantPolicy(2))
    theta = GaussianParameters(jnp.asarray([5.0, 2.0]), y=jnp.asarray(-1.0))
    found = rollout_gradient(policy, theta, bandit, KEY, 4_000)
    exact = -2 * C @ jnp.asarray([1.0, -2.0])
    assert np.all(np.abs(found.gradient.theta - exact) < 4 * found.error.theta)
    assert np.all(np.abs(found.gradient.y + jnp.exp(-1.0) * 5) < 4 * found.error.y)
    assert float(found.error.y) < 0.1


@pytest.mark.parametrize(
    ("options", "steps"),
    [
        ({}, 1 + 0.9 + 0.81),
        ({"horizon": 2, "gamma": 0.5}, 1.5),
        ({"horizon": 10, "gamma": 1.0}, 3),
        ({"gamma": 0.0}, 1),
    ],
)
def test_rewards_count_until_termination_or_the_horizon(options, steps):
    # d(3^2) = 6 at each step
    found = rollout_gradient(ConstantPolicy(1), jnp.asarray([3.0]), Echo(3), KEY, 2, **options)
    np.testing.assert_allclose(found.gradient, [6 * steps], rtol=1e-6)


def test_it_may_be_compiled():
    def play(theta):
        return rollout_gradient(ConstantPolicy(1), theta, Echo(3), KEY, 2)

    theta = jnp.asarray([3.0])
    assert jax.jit(play)(theta).rollouts.tolist() == play(theta).rollouts.tolist()


def test_directions_are_summed_with_their_discount():
    # positions 0, 1, 2, then the end
    found = rollout_directions(
        lambda s, a: s[:1] + a, ConstantPolicy(1), jnp.asarray([1.0]), Chain(3), KEY, 4
    )
    np.testing.assert_allclose(found, np.full((4, 1), 1 + 2 * 0.9 + 3 * 0.81), rtol=1e-6)


def test_theorem_1_along_rollouts():
    world, gain = LQR(noise=0.2, start=0.7), jnp.asarray(K)

    def direction(s, a):
        return deterministic_direction(POLICY, gain, s, lambda x: world.action_value(gain, s, x))

    found = np.asarray(
        rollout_directions(direction, POLICY, gain, world, jax.random.key(3), 4_000, horizon=100)
    )
    error = found.std(axis=0, ddof=1) / np.sqrt(len(found))
    assert np.all(np.abs(found.mean(axis=0) - lqr_gradient(world, gain).gradient) < 4 * error)


@pytest.mark.parametrize("world", [Stairs(3), Chain(3)], ids=["rounds", "ignores the action"])
def test_a_world_that_is_not_differentiable_is_refused(world):
    with pytest.raises(ValueError, match="exactly zero in every rollout"):
        rollout_gradient(ConstantPolicy(1), jnp.asarray([0.3]), world, KEY, 2)


def test_an_optimum_is_not_refused():
    bandit = QuadraticBandit(m=2)
    found = rollout_gradient(ConstantPolicy(2), bandit.a_star, bandit, KEY, 2)
    assert found.gradient.tolist() == [0, 0]


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"policy": LinearPolicy(2, 2), "theta": jnp.zeros((2, 2))}, r"action has shape \(2,\)"),
        (
            {"policy": LinearPolicy(3, 1), "theta": jnp.zeros((1, 3))},
            "does not take an observation",
        ),
        ({"theta": jnp.zeros((2, 1))}, "shaped like"),
        ({"num_rollouts": 1}, "num_rollouts = 1"),
        ({"horizon": 0}, "horizon = 0"),
        ({"gamma": 1.5}, "gamma = 1.5"),
    ],
)
def test_what_does_not_fit_is_refused(changed, words):
    parts = {"policy": POLICY, "theta": jnp.asarray(K), "environment": LQR(), "key": KEY}
    parts |= {"num_rollouts": 2} | changed
    with pytest.raises(ValueError, match=words):
        rollout_gradient(**parts)
    with pytest.raises(ValueError, match=words):
        rollout_directions(lambda s, a: a, **parts)


@pytest.mark.usefixtures("unchecked")
def test_a_gain_without_a_gradient_is_refused():
    with pytest.raises(ValueError, match=r"give one of shape \(1, 2\)"):
        lqr_gradient(LQR(), jnp.zeros((2, 1)))
    with pytest.raises(ValueError, match="J is infinite"):
        lqr_gradient(LQR(), jnp.asarray([[0.0, 2.0]]))


def test_a_known_gradient_is_wrapped():
    assert PolicyGradient({"a": jnp.ones(2)}).error["a"].tolist() == [0, 0]
    rollouts = jnp.asarray([[1.0], [3.0]])
    found = PolicyGradient(jnp.asarray([2.0]), rollouts)
    np.testing.assert_allclose(found.error, [1.0])
    assert dataclasses.fields(found)[1].name == "rollouts"
