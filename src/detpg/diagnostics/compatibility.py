"""How far a critic is from compatible: the residuals of the two conditions of Theorem 3.

Everything is measured on a sample of N states and averaged over it. Standard errors take the states
as independent; they are those of the delta method, the first order in 1 / sqrt(N).
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.core import Tracer
from jax.scipy.sparse.linalg import cg
from jaxtyping import Array, Float, PyTree

from detpg import trees
from detpg.checks import check_action, check_theta, shapes
from detpg.types import Action, Number, Observation, Policy

Observations = Float[Array, "batch obs"]
ActionGradients = Float[Array, "batch act"]


class Condition1(eqx.Module):
    """How far grad_a Q^w is from the span of grad_theta mu^T, condition 1 of Theorem 3.

    Attributes:
        residual: Least mean of |grad_a Q^w - grad_theta mu^T w|^2 over w; 0 where the critic is
            compatible.
        residual_error: Its standard error. The fitted w does not enter to first order, because
            the residual is least there.
        fraction: The residual over the mean of |grad_a Q^w|^2: from 0, compatible, to 1, nothing
            of the critic's gradient can be written as grad_theta mu^T w.
        fraction_error: Its standard error, as of a ratio of two means.
        w: The weights that come nearest, shaped like theta; of many, those of least length.
        unsolved: What the solver left of the normal equations, as a part of their right side; 0 at
            the least residual. Before, the residual is too large: see whether more iterations
            still lower it.
    """

    residual: Number
    residual_error: Number
    fraction: Number
    fraction_error: Number
    w: PyTree
    unsolved: Number


class Condition2(eqx.Module):
    """How far grad_a Q^w is from the true one, condition 2 of Theorem 3.

    Attributes:
        mse: Mean of |epsilon|^2, epsilon = grad_a Q^w - grad_a Q. The condition asks that it be
            least, not that it be 0.
        mse_error: Its standard error.
        fraction: mse over the mean of |grad_a Q|^2.
        fraction_error: Its standard error, as of a ratio of two means.
        direction_bias: Mean of grad_theta mu epsilon, shaped like theta: half the gradient of mse
            in w where condition 1 holds, so 0 where condition 2 does too; and for every critic
            what it adds to the actor's direction on these states.
        direction_bias_error: Its standard error, component by component.
    """

    mse: Number
    mse_error: Number
    fraction: Number
    fraction_error: Number
    direction_bias: PyTree
    direction_bias_error: PyTree


def action_gradients(
    policy: Policy,
    theta: PyTree,
    observations: Observations,
    action_value: Callable[[Observation, Action], Number],
) -> ActionGradients:
    """grad_a Q(s, a) at a = mu_theta(s), in each state.

    Args:
        policy: mu_theta.
        theta: Its parameters.
        observations: The states s.
        action_value: (s, a) -> Q(s, a), differentiable in a.
    """

    def one(observation: Observation) -> Action:
        return jax.grad(action_value, argnums=1)(observation, policy(theta, observation))

    return jax.vmap(one)(observations)


def condition_1(
    policy: Policy,
    theta: PyTree,
    observations: Observations,
    gradients: ActionGradients,
    *,
    max_iterations: int = 2_000,
) -> Condition1:
    """The residual of condition 1: grad_a Q^w(s, a) = grad_theta mu_theta(s)^T w at a = mu(s).

    One w has to serve all states. It is found by conjugate gradients on the normal equations: an
    iteration is one Jacobian-vector and one vector-Jacobian product, no Jacobian is formed. The w
    is fitted to the states it is judged on, which flatters it by about n / (N m).

    Args:
        policy: mu_theta.
        theta: Its parameters.
        observations: The N states.
        gradients: The critic's, of `action_gradients` or one's own.
        max_iterations: Of conjugate gradients.

    Raises:
        ValueError: Shapes that do not fit, no more numbers than parameters, or a critic that does
            not change with the action.
    """
    _check(policy, theta, observations, gradients)
    n = sum(leaf.size for leaf in jax.tree.leaves(theta))
    if gradients.size <= n:
        raise ValueError(
            f"{len(gradients)} states with {gradients.shape[1]} action components can be fitted "
            f"by the {n} parameters whatever the critic: give more than {n // gradients.shape[1]} "
            "states."
        )
    if not isinstance(gradients, Tracer) and not jnp.any(gradients):
        raise ValueError(
            "The critic's action gradient is zero in every state, so nothing can be compared: "
            "give a critic that changes with the action."
        )

    def mu(parameters: PyTree) -> ActionGradients:
        return jax.vmap(lambda s: policy(parameters, s))(observations)

    _, push = jax.linearize(mu, theta)
    _, pull = jax.vjp(mu, theta)
    (target,) = pull(gradients)
    tolerance = float(10 * jnp.finfo(gradients.dtype).eps)
    w, _ = cg(lambda v: pull(push(v))[0], target, tol=tolerance, maxiter=max_iterations)
    rest = gradients - push(w)
    (remainder,) = pull(rest)
    residual, residual_error = _mean(_squares(rest))
    fraction, fraction_error = _ratio(_squares(rest), _squares(gradients))
    # Gradients at right angles to the span leave nothing to solve: 0 / 0 would say nothing.
    right = jnp.maximum(trees.dot(target, target), jnp.finfo(gradients.dtype).tiny)
    unsolved = jnp.sqrt(trees.dot(remainder, remainder) / right)
    return Condition1(residual, residual_error, fraction, fraction_error, w, unsolved)


def condition_2(
    policy: Policy,
    theta: PyTree,
    observations: Observations,
    gradients: ActionGradients,
    true_gradients: ActionGradients,
) -> Condition2:
    """The residual of condition 2: the mean-squared error of grad_a Q^w at a = mu(s).

    Args:
        policy: mu_theta.
        theta: Its parameters.
        observations: The N states.
        gradients: The critic's, of `action_gradients` or one's own.
        true_gradients: grad_a Q^mu in the same states.

    Raises:
        ValueError: Shapes that do not fit.
    """
    _check(policy, theta, observations, gradients)
    _check(policy, theta, observations, true_gradients)
    epsilon = gradients - true_gradients

    def direction(observation: Observation, error: Action) -> PyTree:
        _, pull = jax.vjp(lambda parameters: policy(parameters, observation), theta)
        return pull(error)[0]

    directions = jax.vmap(direction)(observations, epsilon)
    bias = trees.mean(directions)
    bias_error = jax.tree.map(lambda x: jnp.std(x, axis=0, ddof=1) / len(x) ** 0.5, directions)
    mse, mse_error = _mean(_squares(epsilon))
    fraction, fraction_error = _ratio(_squares(epsilon), _squares(true_gradients))
    return Condition2(mse, mse_error, fraction, fraction_error, bias, bias_error)


def _squares(vectors: ActionGradients) -> Float[Array, "batch"]:
    return jnp.sum(vectors**2, axis=1)


def _mean(values: Float[Array, "batch"]) -> tuple[Number, Number]:
    """The mean and its standard error."""
    return jnp.mean(values), jnp.std(values, ddof=1) / len(values) ** 0.5


def _ratio(values: Float[Array, "batch"], scale: Float[Array, "batch"]) -> tuple[Number, Number]:
    """The ratio of two means and its standard error (delta method)."""
    ratio = jnp.mean(values) / jnp.mean(scale)
    _, error = _mean(values - ratio * scale)
    return ratio, error / jnp.mean(scale)


def _check(
    policy: Policy, theta: PyTree, observations: Observations, gradients: ActionGradients
) -> None:
    check_theta(policy, theta)
    found = shapes((observations, gradients))
    if [len(shape) for shape in found] != [2, 2] or len(observations) != len(gradients):
        raise ValueError(
            f"Observations {found[0]} and action gradients {found[1]} do not fit: give one row of "
            "each for every state."
        )
    if len(observations) < 2:
        raise ValueError(f"{len(observations)} states have no standard error: give 2 or more.")
    check_action(policy, theta, observations[0], gradients.shape[1])
