"""The temporal-difference error, and where it stops bootstrapping."""

import jax.numpy as jnp
from jaxtyping import Array, Bool

from detpg.types import Number


def td_error(
    reward: Number, gamma: Number, terminated: Bool[Array, ""], next_value: Number, value: Number
) -> Number:
    """The TD error delta = r + gamma Q(s', a') - Q(s, a) (eq. 11, 16, 19, 23).

    A terminal state has value 0. A time limit does not terminate: its next state is bootstrapped.

    Args:
        reward: r.
        gamma: Discount factor.
        terminated: Whether s' is terminal.
        next_value: Q or V at s'.
        value: Q or V at s.
    """
    return reward + jnp.where(terminated, jnp.zeros_like(reward), gamma * next_value) - value
