"""mu_theta as a multilayer perceptron."""

import dataclasses
from typing import Literal

import jax
import jax.numpy as jnp
from jaxtyping import Array, PRNGKeyArray, PyTree

from detpg.checks import check_choices
from detpg.types import Action, Observation

Unit = Literal["linear", "tanh", "sigmoid", "relu"]
UNITS = {"linear": lambda x: x, "tanh": jnp.tanh, "sigmoid": jax.nn.sigmoid, "relu": jax.nn.relu}


@dataclasses.dataclass(frozen=True)
class MLPPolicy:
    """Hidden layers and an output for each action component; theta is a list of layers.

    Attributes:
        observation_size: d.
        action_size: m.
        hidden: Units of each hidden layer.
        activation: Of the hidden units, "tanh" or "sigmoid" (Section 5.3).
        output: "linear"; "sigmoid" for actions in [0, 1] (Section 5.3); "tanh" for [-1, 1].
        output_width: Standard deviation of the first output weights, times 1 / sqrt(inputs).
    """

    observation_size: int
    action_size: int
    hidden: tuple[int, ...] = (32,)
    activation: Unit = "tanh"
    output: Unit = "linear"
    output_width: float = 0.1

    def __post_init__(self):
        check_choices(self)

    def init(self, key: PRNGKeyArray) -> PyTree:
        """Hidden weights normal with variance 1 / inputs, output weights narrower; biases 0."""
        sizes = (self.observation_size, *self.hidden, self.action_size)
        keys = jax.random.split(key, len(sizes) - 1)
        scales = (*(1.0 for _ in self.hidden), self.output_width)
        return [
            {
                "weight": scale * jax.random.normal(k, (outputs, inputs)) / inputs**0.5,
                "bias": jnp.zeros(outputs),
            }
            for k, scale, inputs, outputs in zip(keys, scales, sizes, sizes[1:], strict=False)
        ]

    def __call__(self, theta: PyTree, observation: Observation) -> Action:
        *hidden, output = theta
        unit = observation
        for layer in hidden:
            unit = UNITS[self.activation](_affine(layer, unit))
        return UNITS[self.output](_affine(output, unit))


def _affine(layer: PyTree, inputs: Array) -> Array:
    return jnp.dot(layer["weight"], inputs, precision="highest") + layer["bias"]
