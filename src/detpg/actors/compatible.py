"""The direction of the compatible deterministic actor (eq. 20)."""

import jax
from jaxtyping import PyTree

from detpg.types import Observation, Policy


def compatible_direction(
    policy: Policy, theta: PyTree, observation: Observation, w: PyTree
) -> PyTree:
    """grad_theta mu_theta(s) (grad_theta mu_theta(s)^T w), shaped like theta (eq. 20).

    The inner product is the critic's action-value gradient at mu_theta(s): one Jacobian-vector
    product; the outer one a vector-Jacobian product. No Jacobian matrix is formed.

    Args:
        policy: mu_theta.
        theta: Its parameters.
        observation: s.
        w: Weights of the compatible critic, shaped like theta.
    """

    def mu(parameters: PyTree):
        return policy(parameters, observation)

    _, action_gradient = jax.jvp(mu, (theta,), (w,))
    _, pull_back = jax.vjp(mu, theta)
    (direction,) = pull_back(action_gradient)
    return direction
