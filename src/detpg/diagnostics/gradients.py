"""The exact gradient of J(mu_theta), and one's own direction along the same rollouts."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float, PRNGKeyArray, PyTree

from detpg import trees
from detpg.checks import check_action, check_theta
from detpg.environments.lqr import LQR
from detpg.types import Action, Environment, Number, Observation, Policy, StochasticPolicy, strong

# Rollouts played side by side: it bounds the memory that the reverse pass takes.
SIDE_BY_SIDE = 256


class PolicyGradient(eqx.Module):
    """grad_theta J, known exactly or as the mean of unbiased rollouts.

    Attributes:
        gradient: grad_theta J, shaped like theta.
        rollouts: Each rollout's own gradient, with a leading axis; None where it is known exactly.
    """

    gradient: PyTree
    rollouts: PyTree | None = None

    @property
    def error(self) -> PyTree:
        """Standard error of each component, over rollouts; 0 where it is known exactly."""
        if self.rollouts is None:
            return trees.zeros_like(self.gradient)
        return jax.tree.map(lambda x: jnp.std(x, axis=0, ddof=1) / len(x) ** 0.5, self.rollouts)


def lqr_gradient(environment: LQR, K: Float[Array, "act obs"]) -> PolicyGradient:
    """grad_K J of mu(s) = K s in closed form, the oracle.

    Raises:
        ValueError: A gain of the wrong shape, or one for which J is infinite.
    """
    d, m = environment.B.shape
    if K.shape != (m, d):
        raise ValueError(
            f"The gain has shape {K.shape}, but this LQR has {d} states and {m} actions: "
            f"give one of shape ({m}, {d})."
        )
    if not any(isinstance(x, Tracer) for x in jax.tree.leaves((environment, K))):
        closed = np.asarray(environment.A) + np.asarray(environment.B) @ np.asarray(K)
        radius = float(np.max(np.abs(np.linalg.eigvals(closed))))
        if environment.gamma * radius**2 >= 1:
            raise ValueError(
                f"J is infinite for this gain: gamma |eigenvalue of A + B K|^2 is "
                f"{environment.gamma * radius**2:.3g}, give a gain for which it is below 1."
            )
    return PolicyGradient(jax.grad(environment.objective)(K))


def rollout_gradient(
    policy: Policy,
    theta: PyTree,
    environment: Environment,
    key: PRNGKeyArray,
    num_rollouts: int,
    *,
    horizon: int | None = None,
    gamma: float | None = None,
) -> PolicyGradient:
    """grad_theta J by differentiation through rollouts of the environment.

    Chance enters the environment by its key alone, so a rollout with fixed keys is a function of
    theta, and its gradient is an unbiased sample of grad J where `transition`, `reward` and
    `observe` are differentiable. A termination that depends on the action adds a term that no
    derivative sees: the result is then not the gradient. J stops at the horizon, which leaves out
    gamma^horizon of an endless task.

    Args:
        policy: mu_theta; a stochastic one acts by `sample`, and J is then its own J(pi).
        theta: Its parameters.
        environment: The world.
        key: Of the rollouts.
        num_rollouts: How many; memory grows with their number times n.
        horizon: Steps of a rollout; the environment's time limit when not given.
        gamma: Discount factor; the environment's when not given.

    Raises:
        ValueError: Parts that do not fit, or an environment that is not differentiable.
    """
    _check(policy, theta, environment, key, num_rollouts, horizon, gamma)

    def total(parameters: PyTree, key: PRNGKeyArray) -> Number:
        return _discounted(_reward, policy, parameters, environment, key, horizon, gamma)

    def gradients(parameters: PyTree) -> PyTree:
        keys = jax.random.split(key, num_rollouts)
        side_by_side = min(num_rollouts, SIDE_BY_SIDE)
        return jax.lax.map(lambda k: jax.grad(total)(parameters, k), keys, batch_size=side_by_side)

    rollouts = gradients(theta)
    # At an optimum the gradient is zero too, but not beside it.
    if _flat(rollouts) and _flat(gradients(_beside(theta))):
        raise ValueError(
            "The return's gradient is exactly zero in every rollout: the environment is not "
            "differentiable in the action or ignores it, or the policy ignores theta; give an "
            "environment with derivatives, and a theta that the policy responds to."
        )
    return PolicyGradient(trees.mean(rollouts), rollouts)


def rollout_directions(
    direction: Callable[[Observation, Action], PyTree],
    policy: Policy,
    theta: PyTree,
    environment: Environment,
    key: PRNGKeyArray,
    num_rollouts: int,
    *,
    horizon: int | None = None,
    gamma: float | None = None,
) -> PyTree:
    """One's own direction summed over rollouts, sum_t gamma^t direction(s_t, a_t).

    The states have the density rho^mu of Section 2.1, whose mass is up to 1 / (1 - gamma), not 1:
    by Theorem 1 the mean over rollouts of grad_theta mu grad_a Q^mu is grad J, and so is that of
    the score times Q^pi for a stochastic policy. Rollouts are independent; states of one are not.

    Args:
        direction: (s, a) -> a direction shaped like theta.
        policy: mu_theta; a stochastic one acts by `sample`.
        theta: Its parameters.
        environment: The world; it need not be differentiable.
        key: Of the rollouts.
        num_rollouts: How many.
        horizon: Steps of a rollout; the environment's time limit when not given.
        gamma: Discount factor; the environment's when not given.

    Returns:
        Directions with a leading axis over rollouts.

    Raises:
        ValueError: Parts that do not fit.
    """
    _check(policy, theta, environment, key, num_rollouts, horizon, gamma)

    def seen(observation: Observation, action: Action, reward: Number) -> PyTree:
        return direction(observation, action)

    def one(key: PRNGKeyArray) -> PyTree:
        return _discounted(seen, policy, theta, environment, key, horizon, gamma)

    keys = jax.random.split(key, num_rollouts)
    return jax.lax.map(one, keys, batch_size=min(num_rollouts, SIDE_BY_SIDE))


def _reward(observation: Observation, action: Action, reward: Number) -> Number:
    return reward


def _discounted(
    seen: Callable[[Observation, Action, Number], PyTree],
    policy: Policy,
    theta: PyTree,
    environment: Environment,
    key: PRNGKeyArray,
    horizon: int | None,
    gamma: float | None,
) -> PyTree:
    """sum_t gamma^t seen(s_t, a_t, r_t) of one rollout."""
    start_key, loop_key = jax.random.split(key)
    start = environment.initial(start_key)
    discount = strong(environment.spec.discount if gamma is None else gamma)

    def step(key: PRNGKeyArray, state: PyTree) -> tuple[PyTree, PyTree]:
        action_key, environment_key = jax.random.split(key)
        observation = environment.observe(state)
        action = _act(policy, action_key, theta, observation)
        next_state = environment.transition(environment_key, state, action)
        reward = environment.reward(state, action, next_state)
        return next_state, seen(observation, action, reward)

    def body(
        carry: tuple[PyTree, Number, PyTree], t: Array
    ) -> tuple[tuple[PyTree, Number, PyTree], None]:
        state, weight, total = carry
        # After the end the weight is 0. Played on from there, a reward might be no number, and
        # neither would its gradient be, weight 0 or not; from the start it is one.
        state = trees.where(weight > 0, state, start)
        next_state, term = step(jax.random.fold_in(loop_key, t), state)
        total = trees.add_scaled(total, weight, term)
        over = environment.terminated(next_state)
        return (next_state, jnp.where(over, 0.0, discount * weight), total), None

    nothing = jax.tree.map(
        lambda x: jnp.zeros(x.shape, x.dtype), jax.eval_shape(step, start_key, start)[1]
    )
    steps = jnp.arange(environment.spec.time_limit if horizon is None else horizon)
    return jax.lax.scan(body, (start, jnp.ones_like(discount), nothing), steps)[0][2]


def _act(policy: Policy, key: PRNGKeyArray, theta: PyTree, observation: Observation) -> Action:
    if isinstance(policy, StochasticPolicy):
        return policy.sample(key, theta, observation)
    return policy(theta, observation)


def _flat(rollouts: PyTree) -> bool:
    """Whether every component is zero; of traced ones it is not known."""
    leaves: list[Any] = jax.tree.leaves(rollouts)
    return not any(isinstance(x, Tracer) or bool(jnp.any(x != 0)) for x in leaves)


def _beside(theta: PyTree) -> PyTree:
    vector = trees.to_vector(theta)
    nudge = jax.random.normal(jax.random.key(0), vector.shape, vector.dtype)
    return trees.like(theta, vector + nudge)


def _check(
    policy: Policy,
    theta: PyTree,
    environment: Environment,
    key: PRNGKeyArray,
    num_rollouts: int,
    horizon: int | None,
    gamma: float | None,
) -> None:
    observation = jax.eval_shape(lambda k: environment.observe(environment.initial(k)), key)
    check_theta(policy, theta)
    check_action(policy, theta, observation, environment.spec.action_size)
    if num_rollouts < 2:
        raise ValueError(f"num_rollouts = {num_rollouts} has no standard error: give 2 or more.")
    if horizon is not None and horizon < 1:
        raise ValueError(f"horizon = {horizon} is not usable: give a positive number of steps.")
    if gamma is not None and not 0 <= gamma <= 1:
        raise ValueError(f"gamma = {gamma:g} is not usable: give a discount between 0 and 1.")
