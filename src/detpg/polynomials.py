"""Products of entries: what quadratic features and values are made of."""

import jax.numpy as jnp
from jaxtyping import Array, Float


def num_products(size: int) -> int:
    """Length of `products` of a vector of that size."""
    return size * (size + 1) // 2


def products(entries: Float[Array, "entries"]) -> Float[Array, "feat"]:
    """All products of two entries of a vector, each pair once."""
    return jnp.outer(entries, entries)[jnp.triu_indices(entries.size)]
