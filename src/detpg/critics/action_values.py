"""Differentiable action values Q^w(s, a): the critics of DAC and OPDAC."""

import dataclasses

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray, PyTree

from detpg.polynomials import num_products, products
from detpg.types import Action, Number, Observation


@dataclasses.dataclass(frozen=True)
class QuadraticActionValue:
    """Q^w(s, a) = sum of w over all products of two entries of (1, s, a).

    Attributes:
        observation_size: d.
        action_size: m.
    """

    observation_size: int
    action_size: int

    def init(self, key: PRNGKeyArray) -> Float[Array, "feat"]:
        """Zero weights w."""
        return jnp.zeros(num_products(1 + self.observation_size + self.action_size))

    def __call__(self, w: Float[Array, "feat"], observation: Observation, action: Action) -> Number:
        one = jnp.ones(1, dtype=observation.dtype)
        entries = jnp.concatenate([one, observation, action])
        return jnp.dot(w, products(entries), precision="highest")


@dataclasses.dataclass(frozen=True)
class MLPActionValue:
    """Q^w(s, a) as one hidden layer of tanh units over (s, a).

    Attributes:
        observation_size: d.
        action_size: m.
        hidden: Units.
    """

    observation_size: int
    action_size: int
    hidden: int = 32

    def init(self, key: PRNGKeyArray) -> PyTree:
        """Hidden weights normal with variance 1 / inputs; output weights 0, so that Q = 0."""
        inputs = self.observation_size + self.action_size
        return {
            "weight": jax.random.normal(key, (self.hidden, inputs)) / inputs**0.5,
            "bias": jnp.zeros(self.hidden),
            "output": jnp.zeros(self.hidden),
        }

    def __call__(self, w: PyTree, observation: Observation, action: Action) -> Number:
        entries = jnp.concatenate([observation, action])
        hidden = jnp.tanh(jnp.dot(w["weight"], entries, precision="highest") + w["bias"])
        return jnp.dot(w["output"], hidden, precision="highest")
