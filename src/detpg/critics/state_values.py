"""Differentiable state values V^v(s): the baseline of the compatible critic."""

import dataclasses

import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from detpg.types import Number, Observation


@dataclasses.dataclass(frozen=True)
class QuadraticStateValue:
    """V^v(s) = v^T phi(s), phi(s) all products of two entries of (1, s).

    Attributes:
        observation_size: d.
    """

    observation_size: int

    def init(self, key: PRNGKeyArray) -> Float[Array, "feat"]:
        """V = 0."""
        size = 1 + self.observation_size
        return jnp.zeros(size * (size + 1) // 2)

    def __call__(self, v: Float[Array, "feat"], observation: Observation) -> Number:
        entries = jnp.concatenate([jnp.ones(1, dtype=observation.dtype), observation])
        products = jnp.outer(entries, entries)[jnp.triu_indices(entries.size)]
        return jnp.dot(v, products, precision="highest")
