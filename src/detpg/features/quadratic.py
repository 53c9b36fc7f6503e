"""x(s) as all products of two entries of (1, s)."""

import dataclasses

import jax.numpy as jnp
from jaxtyping import Array, Float

from detpg.polynomials import num_products, products
from detpg.types import Observation


@dataclasses.dataclass(frozen=True)
class QuadraticFeatures:
    """All products of two entries of (1, s): a constant, s itself, its squares and products.

    Attributes:
        observation_size: d.
    """

    observation_size: int

    @property
    def size(self) -> int:
        """(d + 1)(d + 2) / 2."""
        return num_products(1 + self.observation_size)

    def __call__(self, observation: Observation) -> Float[Array, "feat"]:
        return products(jnp.concatenate([jnp.ones(1, dtype=observation.dtype), observation]))
