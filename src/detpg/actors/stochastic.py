"""The direction of the stochastic actor (eq. 2)."""

import jax
from jaxtyping import Array, Float, PyTree


def likelihood_ratio_direction(score: PyTree, value: Float[Array, ""]) -> PyTree:
    """grad_theta log pi_theta(a|s) times a value of (s, a), shaped like theta (eq. 2).

    Args:
        score: grad_theta log pi_theta(a|s).
        value: Q(s, a), an advantage or a TD error: the readings differ by a baseline.
    """
    return jax.tree.map(lambda component: component * value, score)
