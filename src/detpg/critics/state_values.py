"""Differentiable state values V^v(s): the baseline of the compatible critic."""

import dataclasses
from typing import Literal

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray, PyTree

from detpg.checks import check_choices
from detpg.polynomials import num_products, products
from detpg.types import Features, Number, Observation


@dataclasses.dataclass(frozen=True)
class LinearStateValue:
    """V^v(s) = v^T phi(s), phi(s) any features.

    Attributes:
        features: phi.
    """

    features: Features

    def init(self, key: PRNGKeyArray) -> Float[Array, "feat"]:
        """Zero weights v."""
        return jnp.zeros(self.features.size)

    def __call__(self, v: Float[Array, "feat"], observation: Observation) -> Number:
        return jnp.dot(v, self.features(observation), precision="highest")


@dataclasses.dataclass(frozen=True)
class QuadraticStateValue:
    """V^v(s) = v^T phi(s), phi(s) all products of two entries of (1, s).

    Attributes:
        observation_size: d.
    """

    observation_size: int

    def init(self, key: PRNGKeyArray) -> Float[Array, "feat"]:
        """Zero weights v."""
        return jnp.zeros(num_products(1 + self.observation_size))

    def __call__(self, v: Float[Array, "feat"], observation: Observation) -> Number:
        entries = jnp.concatenate([jnp.ones(1, dtype=observation.dtype), observation])
        return jnp.dot(v, products(entries), precision="highest")


@dataclasses.dataclass(frozen=True)
class MLPStateValue:
    """V^v(s) as one hidden layer (Section 5.3: 40 units) and a linear output.

    Attributes:
        observation_size: d.
        hidden: Units.
        activation: Of the hidden units; the paper does not say which.
    """

    observation_size: int
    hidden: int = 40
    activation: Literal["tanh", "sigmoid"] = "tanh"

    def __post_init__(self):
        check_choices(self)

    def init(self, key: PRNGKeyArray) -> PyTree:
        """Hidden weights normal with variance 1 / inputs; output weights 0, so that V = 0."""
        inputs = self.observation_size
        return {
            "weight": jax.random.normal(key, (self.hidden, inputs)) / inputs**0.5,
            "bias": jnp.zeros(self.hidden),
            "output": jnp.zeros(self.hidden),
            "constant": jnp.zeros(()),
        }

    def __call__(self, v: PyTree, observation: Observation) -> Number:
        hidden = jnp.dot(v["weight"], observation, precision="highest") + v["bias"]
        unit = jnp.tanh(hidden) if self.activation == "tanh" else jax.nn.sigmoid(hidden)
        return jnp.dot(v["output"], unit, precision="highest") + v["constant"]
