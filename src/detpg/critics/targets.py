"""What a critic with target networks is regressed on."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from detpg.types import Number


def n_step_target(
    rewards: Float[Array, "batch n"],
    gamma: Number,
    steps: Int[Array, "batch"],
    terminated: Bool[Array, "batch"],
    next_value: Float[Array, "batch"],
) -> Float[Array, "batch"]:
    """Y = sum_k gamma^k r_k + gamma^m Q'(s_m, mu'(s_m)), without the last where s_m is terminal.

    Args:
        rewards: r_0 ... r_(m - 1), then zeros.
        gamma: Discount factor.
        steps: m, at most n.
        terminated: Whether s_m is terminal.
        next_value: Q' there.
    """
    weights = gamma ** jnp.arange(rewards.shape[1], dtype=rewards.dtype)
    tail = gamma ** steps.astype(rewards.dtype) * next_value
    earned = jnp.sum(rewards * weights[None], axis=1)
    return earned + jnp.where(terminated, jnp.zeros_like(tail), tail)


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
