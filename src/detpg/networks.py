"""Layers of units, the shared arithmetic of network policies and action values."""

import dataclasses
from typing import Literal

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray, PyTree

Norm = Literal["none", "first", "all"]


@dataclasses.dataclass(frozen=True)
class Network:
    """ReLU layers from a vector to a vector; the parameters are a list of layers.

    Attributes:
        inputs: Length of the vector that goes in.
        hidden: Units of each hidden layer.
        outputs: Length of the vector that comes out.
        norm: "none"; "first": LayerNorm and tanh after the first layer, as Acme's critics have;
            "all": LayerNorm before every ReLU.
        output_width: Half width of the uniform output weights at the start, times 1 / sqrt(inputs).
    """

    inputs: int
    hidden: tuple[int, ...]
    outputs: int
    norm: Norm = "none"
    output_width: float = 1.0

    def init(self, key: PRNGKeyArray) -> PyTree:
        """Weights and biases uniform within 1 / sqrt(inputs) of 0, as PyTorch starts them."""
        sizes = (self.inputs, *self.hidden, self.outputs)
        keys = jax.random.split(key, len(sizes) - 1)
        widths = (*(1.0 for _ in self.hidden), self.output_width)
        return [
            _layer(k, before, after, width * before**-0.5)
            for k, before, after, width in zip(keys, sizes, sizes[1:], widths, strict=False)
        ]

    def __call__(self, parameters: PyTree, entries: Float[Array, "inputs"]) -> Array:
        *hidden, output = parameters
        unit = entries
        for i, layer in enumerate(hidden):
            unit = _affine(layer, unit)
            if self.norm == "first" and i == 0:
                unit = jnp.tanh(layer_norm(unit))
            else:
                unit = jax.nn.relu(layer_norm(unit) if self.norm == "all" else unit)
        return _affine(output, unit)


def layer_norm(unit: Float[Array, "units"]) -> Float[Array, "units"]:
    """(x - mean) / deviation over the units of a layer, without parameters (Ba et al., 2016)."""
    centred = unit - jnp.mean(unit)
    return centred * jax.lax.rsqrt(jnp.mean(centred**2) + 1e-5)


def _layer(key: PRNGKeyArray, inputs: int, outputs: int, width: float) -> PyTree:
    weight_key, bias_key = jax.random.split(key)
    return {
        "weight": jax.random.uniform(weight_key, (outputs, inputs), minval=-width, maxval=width),
        "bias": jax.random.uniform(bias_key, (outputs,), minval=-width, maxval=width),
    }


def _affine(layer: PyTree, inputs: Array) -> Array:
    return jnp.dot(layer["weight"], inputs, precision="highest") + layer["bias"]
