"""mu_theta as a multilayer perceptron."""

import dataclasses

import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray, PyTree

from detpg.types import Action, Observation


@dataclasses.dataclass(frozen=True)
class MLPPolicy:
    """Layers of tanh units and a linear output; theta is a list of weights and biases.

    Attributes:
        observation_size: d.
        action_size: m.
        hidden: Units of each hidden layer.
    """

    observation_size: int
    action_size: int
    hidden: tuple[int, ...] = (32,)

    def init(self, key: PRNGKeyArray) -> PyTree:
        """Hidden weights normal with variance 1 / inputs, output weights a tenth as wide."""
        sizes = (self.observation_size, *self.hidden, self.action_size)
        keys = jax.random.split(key, len(sizes) - 1)
        scales = (*(1.0 for _ in self.hidden), 0.1)
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
            unit = jnp.tanh(jnp.dot(layer["weight"], unit, precision="highest") + layer["bias"])
        return jnp.dot(output["weight"], unit, precision="highest") + output["bias"]
