"""The two conditions of Theorem 3, on numbers by hand, on critics that meet them, on others."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg import trees
from detpg.critics import MLPActionValue, QuadraticActionValue, QuadraticStateValue
from detpg.diagnostics import action_gradients, condition_1, condition_2
from detpg.environments import LQR
from detpg.features import compatible_features
from detpg.policies import LinearPolicy, MLPPolicy
from nonlinear import TwoLayers

K = [[-0.1, -0.4]]
LINE = LinearPolicy(1, 1)
SLOPE = jnp.asarray([[0.5]])
STATES = jnp.asarray([[1.0], [2.0], [2.0]])
OURS = jnp.asarray([[1.0], [2.0], [5.0]])
TRUE = jnp.asarray([[1.0], [1.0], [3.0]])


jitted_1 = jax.jit(condition_1, static_argnums=0)
jitted_2 = jax.jit(condition_2, static_argnums=0)


def drawn(key: int, *shape: int) -> jax.Array:
    return jax.random.normal(jax.random.key(key), shape, dtype=float)


def test_condition_1_by_hand():
    found = condition_1(LINE, SLOPE, STATES, OURS)
    # w = (1 + 4 + 10) / (1 + 4 + 4) = 5/3 leaves (-2, -4, 5) / 3: squares (4, 16, 25) / 9
    np.testing.assert_allclose(found.w, [[5 / 3]], rtol=1e-6)
    np.testing.assert_allclose(found.residual, 5 / 3, rtol=1e-6)
    np.testing.assert_allclose(found.residual_error, np.sqrt(37) / 9, rtol=1e-6)
    # of (1, 4, 25); what enters the error is (4, 16, 25) / 9 - (1, 4, 25) / 6 = (5, 20, -25) / 18
    np.testing.assert_allclose(found.fraction, 1 / 6, rtol=1e-6)
    np.testing.assert_allclose(found.fraction_error, np.sqrt(175) / 180, rtol=1e-5)
    assert float(found.unsolved) < 1e-6


def test_condition_2_by_hand():
    found = condition_2(LINE, SLOPE, STATES, OURS, TRUE)
    # epsilon (0, 1, 2), squares (0, 1, 4) of (1, 1, 9); grad mu epsilon (0, 2, 4)
    np.testing.assert_allclose(found.mse, 5 / 3, rtol=1e-6)
    np.testing.assert_allclose(found.mse_error, np.sqrt(13) / 3, rtol=1e-6)
    np.testing.assert_allclose(found.fraction, 5 / 11, rtol=1e-6)
    # (0, 1, 4) - 5/11 (1, 1, 9) = (-5, 6, -1) / 11
    error = np.sqrt(62 / 121 / 2 / 3) / (11 / 3)
    np.testing.assert_allclose(found.fraction_error, error, rtol=1e-5)
    np.testing.assert_allclose(found.direction_bias, [[2.0]], rtol=1e-6)
    np.testing.assert_allclose(found.direction_bias_error, [[2 / np.sqrt(3)]], rtol=1e-6)


def test_gradients_at_right_angles_are_wholly_outside():
    found = condition_1(LINE, SLOPE, jnp.asarray([[1.0], [-1.0]]), jnp.ones((2, 1)))
    assert (float(found.fraction), float(found.residual), found.w.tolist()) == (1, 1, [[0]])
    assert float(found.unsolved) == 0


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("policy", [TwoLayers(), LinearPolicy(2, 3)], ids=["nonlinear", "linear"])
def test_the_compatible_critic_meets_condition_1(policy):
    """Q = phi(s, a)^T w + V(s) of COPDAC, for any w and any V."""
    theta = jax.tree.map(lambda x: drawn(1, *x.shape), policy.init(jax.random.key(1)))
    w = jax.tree.map(lambda x: drawn(2, *x.shape), theta)
    baseline, v, states = QuadraticStateValue(2), drawn(3, 6), drawn(4, 100, 2)

    def critic(s, a):
        return trees.dot(compatible_features(policy, theta, s, a), w) + baseline(v, s)

    gradients = action_gradients(policy, theta, states, critic)
    found = jitted_1(policy, theta, states, gradients)
    assert float(found.fraction) < 1e-12
    assert float(found.unsolved) < 1e-6
    again = action_gradients(
        policy,
        theta,
        states,
        lambda s, a: trees.dot(compatible_features(policy, theta, s, a), found.w),
    )
    np.testing.assert_allclose(again, gradients, atol=1e-5)


@pytest.mark.usefixtures("x64")
def test_the_residual_against_the_explicit_jacobian():
    policy, states, gradients = TwoLayers(), drawn(1, 100, 2), drawn(2, 100, 3)
    theta = policy.init(jax.random.key(3))
    jacobian = jax.vmap(lambda s: jax.jacobian(policy)(theta, s))(states)
    design = np.concatenate(
        [np.reshape(leaf, (300, -1)) for leaf in jax.tree.leaves(jacobian)], axis=1
    )
    target = np.asarray(gradients).reshape(-1)
    best = np.linalg.lstsq(design, target, rcond=None)[0]
    least = np.sum((target - design @ best) ** 2)
    found = jitted_1(policy, theta, states, gradients)
    np.testing.assert_allclose(found.residual, least / 100, rtol=1e-9)
    np.testing.assert_allclose(found.fraction, least / np.sum(target**2), rtol=1e-9)


@pytest.mark.usefixtures("x64")
def test_a_quadratic_critic_meets_condition_1_on_the_lqr_but_for_its_slope_at_the_origin():
    """grad_a Q at a = K s is linear in s, the span of a linear policy's gradient, plus w_a."""
    world, gain, states = LQR(), jnp.asarray(K), drawn(1, 100, 2)
    policy, critic = LinearPolicy(2, 1), QuadraticActionValue(2, 1)
    exact = action_gradients(policy, gain, states, lambda s, a: world.action_value(gain, s, a))
    assert float(jitted_1(policy, gain, states, exact).fraction) < 1e-20

    slope = 3  # of the products (1, s0, s1, a, ...)
    for at, w in ((0.0, drawn(2, 10).at[slope].set(0.0)), (0.7, drawn(2, 10).at[slope].set(0.7))):
        gradients = action_gradients(policy, gain, states, lambda s, a, w=w: critic(w, s, a))
        found = jitted_1(policy, gain, states, gradients)
        # What is left of a constant, regressed on the states.
        s = np.asarray(states)
        centre, moment = s.mean(axis=0), s.T @ s / len(s)
        least = at**2 * (1 - centre @ np.linalg.solve(moment, centre))
        np.testing.assert_allclose(found.residual, least, rtol=1e-9, atol=1e-20)


def test_an_mlp_critic_does_not_meet_condition_1():
    policy, critic, states = LinearPolicy(2, 1), MLPActionValue(2, 1), drawn(1, 100, 2)
    w = jax.tree.map(lambda x: drawn(2, *x.shape), critic.init(jax.random.key(0)))
    gradients = action_gradients(policy, jnp.asarray(K), states, lambda s, a: critic(w, s, a))
    found = jitted_1(policy, jnp.asarray(K), states, gradients)
    assert float(found.fraction) > 0.1
    assert float(found.fraction) > 10 * float(found.fraction_error)


@pytest.mark.usefixtures("x64")
def test_both_conditions_leave_the_direction_unbiased():
    """Theorem 3: the nearest compatible critic errs, but not in the direction of the actor."""
    policy, states = TwoLayers(), drawn(1, 100, 2)
    theta = policy.init(jax.random.key(2))
    true = jnp.sin(3 * states @ drawn(3, 2, 3))
    w = jitted_1(policy, theta, states, true).w
    compatible = action_gradients(
        policy, theta, states, lambda s, a: trees.dot(compatible_features(policy, theta, s, a), w)
    )
    found = jitted_2(policy, theta, states, compatible, true)
    assert float(found.fraction) > 0.1
    assert all(np.allclose(x, 0, atol=1e-9) for x in jax.tree.leaves(found.direction_bias))

    # A w beside it does not minimise the error: the bias is half the error's gradient in w.
    beside = trees.add_scaled(w, jnp.asarray(0.1, dtype=float), theta)

    def mse(w):
        pushed = jax.vmap(lambda s: jax.jvp(lambda p: policy(p, s), (theta,), (w,))[1])(states)
        return jnp.mean(jnp.sum((pushed - true) ** 2, axis=1)), pushed

    slope, pushed = jax.grad(mse, has_aux=True)(beside)
    bias = jitted_2(policy, theta, states, pushed, true).direction_bias
    for name in theta:
        np.testing.assert_allclose(2 * bias[name], slope[name], rtol=1e-9)
        assert np.max(np.abs(bias[name])) > 1e-3


def test_the_standard_errors_are_the_spread_over_samples():
    policy, repeats, size = LinearPolicy(2, 1), 300, 200
    gain = jnp.asarray(K)

    def once(key):
        states = jax.random.normal(key, (size, 2))
        ours = jnp.sin(2 * states[:, :1]) + 0.5 * states[:, 1:] ** 2
        true = states[:, :1] + 1.0
        first = condition_1(policy, gain, states, ours)
        second = condition_2(policy, gain, states, ours, true)
        values = first.residual, first.fraction, second.mse, second.fraction
        errors = first.residual_error, first.fraction_error, second.mse_error, second.fraction_error
        bias, bias_error = second.direction_bias[0], second.direction_bias_error[0]
        return (
            jnp.concatenate([jnp.stack(values), bias]),
            jnp.concatenate([jnp.stack(errors), bias_error]),
        )

    values, errors = jax.jit(jax.vmap(once))(jax.random.split(jax.random.key(0), repeats))
    spread, said = np.std(values, axis=0, ddof=1), np.mean(errors, axis=0)
    # A standard deviation's relative error is sqrt((kurtosis - 1) / 4 / repeats), here about
    # 1 / sqrt(2 repeats); the delta method leaves out terms of order 1 / size.
    np.testing.assert_allclose(said / spread, 1, atol=4 / np.sqrt(2 * repeats) + 4 / size)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("states", "gradients", "words"),
    [
        (STATES, OURS[:2], "do not fit"),
        (STATES[:, 0], OURS, "do not fit"),
        (STATES[:1], OURS[:1], "no standard error"),
        (jnp.ones((3, 2)), OURS, "does not take an observation"),
        (STATES, jnp.ones((3, 2)), r"action has shape \(1,\)"),
    ],
)
def test_what_does_not_fit_is_refused(states, gradients, words):
    with pytest.raises(ValueError, match=words):
        condition_1(LINE, SLOPE, states, gradients)
    with pytest.raises(ValueError, match=words):
        condition_2(LINE, SLOPE, states, gradients, gradients)


@pytest.mark.usefixtures("unchecked")
def test_the_wrong_theta_is_refused():
    with pytest.raises(ValueError, match="shaped like"):
        condition_1(LINE, jnp.ones((2, 1)), STATES, OURS)
    with pytest.raises(ValueError, match="do not fit"):
        condition_2(LINE, SLOPE, STATES, OURS, TRUE[:2])


def test_what_says_nothing_is_refused():
    with pytest.raises(ValueError, match="zero in every state"):
        condition_1(LINE, SLOPE, STATES, jnp.zeros((3, 1)))
    policy = MLPPolicy(1, 2, hidden=(3,))
    theta = policy.init(jax.random.key(0))  # 3 + 3 + 6 + 2 parameters
    with pytest.raises(ValueError, match="give more than 7 states"):
        condition_1(policy, theta, jnp.ones((7, 1)), jnp.ones((7, 2)))
