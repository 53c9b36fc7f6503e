"""Features compatible with a policy: the only ones that leave its gradient unbiased."""

import jax
from jaxtyping import PyTree

from detpg.types import Action, Observation, Policy, StochasticPolicy


def compatible_features(
    policy: Policy, theta: PyTree, observation: Observation, action: Action
) -> PyTree:
    """phi(s, a) = grad_theta mu_theta(s) (a - mu_theta(s)), shaped like theta (Section 4.3).

    One vector-Jacobian product, never a Jacobian matrix: the paper's O(mn).
    """
    mean, pull_back = jax.vjp(lambda parameters: policy(parameters, observation), theta)
    (phi,) = pull_back(action - mean)
    return phi


def score(
    policy: StochasticPolicy, theta: PyTree, observation: Observation, action: Action
) -> PyTree:
    """grad_theta log pi_theta(a|s), shaped like theta (Section 2.3, condition i)."""
    return jax.grad(policy.log_prob)(theta, observation, action)
