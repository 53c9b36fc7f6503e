"""The direction of the stochastic actor (eq. 2)."""

from typing import Literal

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

Gradient = Literal["plain", "scaled"]


def likelihood_ratio_direction(score: PyTree, value: Float[Array, ""]) -> PyTree:
    """grad_theta log pi_theta(a|s) times a value of (s, a), shaped like theta (eq. 2).

    Args:
        score: grad_theta log pi_theta(a|s).
        value: Q(s, a), an advantage or a TD error: the readings differ by a baseline.
    """
    return jax.tree.map(lambda component: component * value, score)


def gaussian_score(
    x: Float[Array, "feat"],
    deviation: Float[Array, "act"],
    sigma: Float[Array, "act"],
    gradient: Gradient,
) -> tuple[Float[Array, "act feat"], Float[Array, "act feat"]]:
    """grad_u log pi_u(a|s) of a Gaussian on features, for its mean and its width (eq. 2).

    "plain": ((a - mu) / sigma^2) x and ((a - mu)^2 / sigma^2 - 1) x. "scaled": both times sigma^2,
    the gradient scaling of Degris, Pilarski & Sutton (2012).

    Args:
        x: Features of s.
        deviation: a - mu.
        sigma: Standard deviation of each action component.
        gradient: Which of the two.
    """
    variance = sigma**2
    if gradient == "scaled":
        of_mean, of_width = deviation, deviation**2 - variance
    else:
        of_mean, of_width = deviation / variance, deviation**2 / variance - 1
    return jnp.outer(of_mean, x), jnp.outer(of_width, x)
