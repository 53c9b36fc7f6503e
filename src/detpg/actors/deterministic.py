"""The direction of the deterministic actor (eq. 9, 13, 18)."""

from collections.abc import Callable

import jax
from jaxtyping import Array, Float, PyTree

from detpg.types import Action, Number, Observation, Policy


def deterministic_direction(
    policy: Policy,
    theta: PyTree,
    observation: Observation,
    action_value: Callable[[Action], Number],
) -> PyTree:
    """grad_theta mu_theta(s) grad_a Q(s, a) at a = mu_theta(s), shaped like theta (eq. 13, 18).

    One vector-Jacobian product.

    Args:
        policy: mu_theta.
        theta: Its parameters.
        observation: s.
        action_value: a -> Q(s, a), of this s.
    """
    mean, pull_back = jax.vjp(lambda parameters: policy(parameters, observation), theta)
    (direction,) = pull_back(jax.grad(action_value)(mean))
    return direction


def batch_direction(
    policy: Policy,
    theta: PyTree,
    observations: Float[Array, "batch obs"],
    slopes: Callable[[Float[Array, "batch act"]], Float[Array, "batch act"]],
) -> PyTree:
    """The mean over a batch of grad_theta mu_theta(s) grad_a Q(s, a) at mu_theta(s) (eq. 9).

    One vector-Jacobian product for the whole batch: no gradient of a single row is formed.

    Args:
        policy: mu_theta.
        theta: Its parameters.
        observations: s.
        slopes: Actions, one for each s -> grad_a Q there.
    """
    actions, pull_back = jax.vjp(
        lambda parameters: jax.vmap(policy, in_axes=(None, 0))(parameters, observations), theta
    )
    (direction,) = pull_back(slopes(actions) / len(actions))
    return direction
