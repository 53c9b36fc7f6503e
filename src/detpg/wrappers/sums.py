"""Sums of very many numbers, in single precision."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float


class Sum(eqx.Module):
    """A number in two parts, so that what is small beside it is not lost by adding it.

    A plain float32 stands still once what is added is less than 6e-8 of it.

    Attributes:
        value: The number, rounded.
        rest: What rounding took away from it, less than half a last bit.
    """

    value: Float[Array, "..."]
    rest: Float[Array, "..."]

    @classmethod
    def of(cls, value: Float[Array, "..."]) -> "Sum":
        """A number that is exact."""
        return cls(value, jnp.zeros_like(value))

    def add(self, more: Float[Array, "..."]) -> "Sum":
        """With one more number (Knuth's exact sum of two)."""
        more = self.rest + more
        value = self.value + more
        added = value - self.value
        rest = (self.value - (value - added)) + (more - added)
        return Sum(value, rest)
