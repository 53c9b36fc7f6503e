"""What a critic with target networks is regressed on."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from detpg.experience import Recalled
from detpg.types import Number


def n_step_target(
    rows: Recalled, gamma: Number, next_value: Float[Array, "batch"]
) -> Float[Array, "batch"]:
    """Y = sum_k gamma^k r_k + gamma^m Q'(s_m, mu'(s_m)), without the last where s_m is terminal.

    Args:
        rows: Of up to n steps, m in each.
        gamma: Discount factor.
        next_value: Q' where each row ends.
    """
    weights = gamma ** jnp.arange(rows.rewards.shape[1], dtype=rows.rewards.dtype)
    tail = gamma ** rows.steps.astype(next_value.dtype) * next_value
    earned = jnp.sum(rows.rewards * weights[None], axis=1)
    return earned + jnp.where(rows.terminated, jnp.zeros_like(tail), tail)


def smoothing_noise(
    key: PRNGKeyArray, actions: Float[Array, "batch act"], sigma: Number, most: Number
) -> Float[Array, "batch act"]:
    """clip(e, -c, c), e ~ N(0, sigma^2) for each row and component: TD3's target smoothing.

    Args:
        key: Of the draw.
        actions: What it is added to, for its shape.
        sigma: Standard deviation, units of the box.
        most: c.
    """
    return jnp.clip(sigma * jax.random.normal(key, actions.shape, actions.dtype), -most, most)
