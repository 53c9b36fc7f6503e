"""The closed forms behind the checks against sums, samples and differences."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg import trees
from detpg.policies import LinearPolicy
from detpg.theorems import worlds
from detpg.theorems.behaviour_value import mean_slopes, ring
from detpg.theorems.off_policy import DIRECTION, best_gain, objective, visited
from detpg.theorems.theorem_1 import discounted_states
from detpg.theorems.theorem_2 import DENSITIES, WIDTHS, stochastic_gradient
from detpg.theorems.variance import shared_shaft
from detpg.theorems.worlds import Ring, certain, gaussian, regulator, solve


def test_the_ring_goes_where_its_chances_say():
    world, action = Ring(jnp.eye(5)), jnp.asarray([0.8])
    keys = jax.random.split(jax.random.key(0), 20_000)
    seen = jax.vmap(lambda k: world.transition(k, jnp.asarray(2), action))(keys)
    chances = np.asarray(world.chances(jnp.asarray(2), action))
    error = np.sqrt(chances * (1 - chances) / 20_000)
    assert np.all(np.abs(np.bincount(seen, minlength=5) / 20_000 - chances) < 4 * error)


@jax.jit
def solved(world, theta, sigma, quadrature):
    return solve(world, LinearPolicy(5, 1), theta, sigma, quadrature)


def kernel_and_reward(world: Ring, actions: np.ndarray, weights: np.ndarray):
    """P and r of a policy, state by state, in NumPy."""
    x = 2 * np.pi * np.arange(world.num_states) / world.num_states
    kernel = np.zeros((world.num_states, world.num_states))
    reward = np.zeros(world.num_states)
    for s, per_state in enumerate(actions):
        for a, weight in zip(per_state, weights, strict=True):
            preference = np.exp(2 * np.cos(x - x[s] - a))
            kernel[s] += weight * preference / preference.sum()
            reward[s] += weight * (np.cos(x[s] - 1) + np.exp(-((a - np.sin(x[s])) ** 2)))
    return kernel, reward


@pytest.mark.parametrize("sigma", [0.0, 0.7])
def test_values_are_sums_over_time(x64, sigma: float):
    world, theta = ring()
    quadrature = gaussian(16)
    found = solved(world, theta, jnp.asarray(sigma), quadrature)
    actions = np.asarray(theta[0])[:, None] + sigma * np.asarray(quadrature.nodes)
    kernel, reward = kernel_and_reward(world, actions, np.asarray(quadrature.weights))
    value, visits, reached = np.zeros(5), np.zeros(5), np.full(5, 0.2)
    for t in range(200):  # 0.8^200 = 4e-20
        value += world.gamma**t * np.linalg.matrix_power(kernel, t) @ reward
        visits += world.gamma**t * reached
        reached = reached @ kernel
    np.testing.assert_allclose(found.value, value, rtol=1e-12)
    np.testing.assert_allclose(found.visits, visits, rtol=1e-12)
    np.testing.assert_allclose(found.objective, visits @ reward, rtol=1e-12)
    mean = np.asarray(found.action_values) @ np.asarray(quadrature.weights)
    np.testing.assert_allclose(mean, value, rtol=1e-12)


def test_the_deterministic_gradient_agrees_with_finite_differences(x64):
    world, policy, theta = worlds.ring_and_network()
    vector = trees.to_vector(theta)

    @jax.jit
    def worth(at):
        return solve(world, policy, trees.like(theta, at), jnp.zeros(()), certain()).objective

    nudges = 1e-5 * jnp.eye(vector.size)
    ends = [jax.vmap(worth)(vector[None] + sign * nudges) for sign in (1.0, -1.0)]
    expected = (ends[0] - ends[1]) / 2e-5
    found = worlds.deterministic_gradient(world, policy, theta)
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("name", ["gaussian", "skewed"])
def test_eq_2_is_the_gradient_of_the_stochastic_objective(x64, name: str):
    """Theorem 2's left side, by quadrature of the score, against differentiation of J(pi)."""
    world, policy, theta = worlds.ring_and_network()
    sigma, quadrature = jnp.asarray(0.3), DENSITIES[name].quadrature(64)
    worth = jax.grad(lambda p: solve(world, policy, p, sigma, quadrature).objective)
    found = jax.jit(partial(stochastic_gradient, policy=policy, density=DENSITIES[name]))(
        world, theta, sigma
    )
    np.testing.assert_allclose(found, trees.to_vector(jax.jit(worth)(theta)), rtol=1e-9)


@pytest.mark.parametrize("name", DENSITIES)
def test_densities_have_the_moments_that_decide_the_order(x64, name: str):
    nodes, weights = map(np.asarray, DENSITIES[name].quadrature(64))
    assert weights.sum() == pytest.approx(1)
    skewed = DENSITIES[name].order == 1
    assert abs(weights @ nodes) == pytest.approx(1 / 11 if skewed else 0, abs=1e-14)
    assert np.ptp(np.log2(WIDTHS)) == len(WIDTHS) - 1


def test_states_are_drawn_from_the_discounted_distribution(x64):
    world, gain = regulator()
    draw = jax.jit(partial(discounted_states, num_states=20_000))
    states = np.asarray(draw(jax.random.key(3), world, gain))
    products = states[:, :, None] * states[:, None, :]
    expected = (1 - world.gamma) * np.asarray(world.state_moment(gain))
    error = products.std(axis=0) / np.sqrt(len(states))
    assert np.all(np.abs(products.mean(axis=0) - expected) < 4 * error)


def test_a_few_states_carry_the_behaviour_s_distribution(x64):
    """J_beta in closed form is the sum of V over them."""
    world, gain = regulator()
    behaviour = gain + 0.5 * jnp.asarray(DIRECTION)
    states, weight = jax.jit(partial(visited, world))(behaviour)
    values = jax.jit(jax.vmap(partial(world.value, gain)))(states)
    expected = jax.jit(partial(objective, world))(behaviour, gain)
    np.testing.assert_allclose(weight * values.sum(), expected, rtol=1e-12)
    moment = float(weight) * np.asarray(states).T @ np.asarray(states)
    expected = eqx.filter_jit(world.state_moment)(behaviour)
    np.testing.assert_allclose(moment, expected, rtol=1e-10, atol=1e-12)


def test_the_best_gain_has_no_gradient(x64):
    world, gain = regulator()
    gradient = jax.jit(jax.grad(world.objective))
    best = jax.jit(partial(best_gain, world))(gain)
    assert np.linalg.norm(gradient(best)) < 1e-12 * np.linalg.norm(gradient(gain))


def test_motors_on_one_shaft_are_one_motor(x64):
    (one, gain), (many, gains) = shared_shaft(1), shared_shaft(7)
    for quantity in ("objective", "state_moment"):
        of_many, of_one = (eqx.filter_jit(getattr(world, quantity)) for world in (many, one))
        np.testing.assert_allclose(of_many(gains), of_one(gain), rtol=1e-12)


def test_the_mean_slope_is_stein_s_regression(x64):
    """E_beta of grad_a Q is what regressing Q on the noise gives: E[e Q] / sigma^2."""
    world, theta = ring()
    sigma, quadrature = jnp.asarray(0.7), gaussian()
    _, slopes = jax.jit(partial(mean_slopes, world, theta))(sigma)
    exact = solved(world, theta, sigma, quadrature)
    regressed = np.asarray(exact.action_values) @ np.asarray(quadrature.weights * quadrature.nodes)
    np.testing.assert_allclose(slopes, regressed / 0.7, rtol=1e-7)
