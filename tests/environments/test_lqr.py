"""The closed forms of the LQR against what they stand for."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.actors import compatible_direction
from detpg.environments import LQR
from detpg.policies import LinearPolicy

K = [[-0.1, -0.4]]


def lqr() -> LQR:
    return LQR(noise=0.2, start=0.7)


def test_the_value_solves_the_bellman_equation(x64):
    world, gain = lqr(), jnp.asarray(K)
    for state in jnp.asarray([[0.0, 0.0], [1.0, -2.0], [3.0, 0.5]]):
        action = gain @ state
        np.testing.assert_allclose(
            world.action_value(gain, state, action), world.value(gain, state), rtol=1e-12
        )


def test_the_value_is_the_mean_discounted_return():
    world, gain = lqr(), jnp.asarray(K)
    start = jnp.asarray([1.0, -1.0])
    steps, runs = 150, 4000  # 0.9^150 = 1e-7

    def discounted_return(key):
        def body(state, at):
            action = gain @ state
            next_state = world.transition(jax.random.fold_in(key, at), state, action)
            reward = world.reward(state, action, next_state)
            return next_state, jnp.asarray(world.gamma) ** at.astype(float) * reward

        return jnp.sum(jax.lax.scan(body, start, jnp.arange(steps))[1])

    returns = np.asarray(jax.vmap(discounted_return)(jax.random.split(jax.random.key(0), runs)))
    error = returns.std() / np.sqrt(runs)
    assert abs(returns.mean() - float(world.value(gain, start))) < 4.5 * error


def test_theorem_1_in_closed_form(x64):
    """grad J by differentiation is the mean of grad mu grad_a Q over rho^mu."""
    world, gain = lqr(), jnp.asarray(K)
    exact = jax.grad(world.objective)(gain)

    def slope(state):
        return jax.grad(world.action_value, argnums=2)(gain, state, gain @ state)

    # grad_a Q is linear in s, so its mean against s needs only the second moment of rho.
    slopes = jax.vmap(slope)(jnp.eye(2)).T
    np.testing.assert_allclose(slopes @ world.state_moment(gain), exact, rtol=1e-10)


def test_the_objective_agrees_with_finite_differences(x64):
    world, gain, step = lqr(), np.asarray(K), 1e-5
    exact = np.asarray(jax.grad(world.objective)(jnp.asarray(gain)))
    for j in range(2):
        nudge = step * np.eye(2)[[j]]
        ends = [float(world.objective(jnp.asarray(gain + sign * nudge))) for sign in (1, -1)]
        assert (ends[0] - ends[1]) / (2 * step) == pytest.approx(exact[0, j], rel=1e-7)


def test_the_compatible_solution_gives_the_exact_gradient(x64):
    """Theorem 3: w that satisfies grad mu^T w = grad_a Q at mu in every state gives grad J."""
    world, gain, policy = lqr(), jnp.asarray(K), LinearPolicy(2, 1)
    w = jax.vmap(lambda s: jax.grad(world.action_value, argnums=2)(gain, s, gain @ s))(jnp.eye(2)).T
    # With mu = theta s, grad mu^T w = w s, which is grad_a Q for this w in every state.
    moment = world.state_moment(gain)
    root = jnp.linalg.cholesky(moment)
    directions = jax.vmap(lambda s: compatible_direction(policy, gain, s, w))(root.T)
    np.testing.assert_allclose(
        jnp.sum(directions, axis=0), jax.grad(world.objective)(gain), rtol=1e-10
    )


def test_sizes_that_disagree_are_refused(unchecked):
    with pytest.raises(ValueError, match="do not fit"):
        LQR(A=[[1.0]], B=[[1.0], [0.0]])
