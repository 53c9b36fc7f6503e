"""The policy of a problem with one state: mu_theta = theta (Section 5.1)."""

import dataclasses

import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from detpg.types import Action, Observation


@dataclasses.dataclass(frozen=True)
class ConstantPolicy:
    """mu_theta(s) = theta for every s: the target policy of COPDAC-B.

    Attributes:
        action_size: m, the length of theta and of the action.
    """

    action_size: int

    def init(self, key: PRNGKeyArray) -> Float[Array, "act"]:
        """Zero parameters theta; the paper does not say where it starts."""
        return jnp.zeros(self.action_size)

    def __call__(self, theta: Float[Array, "act"], observation: Observation) -> Action:
        return theta
