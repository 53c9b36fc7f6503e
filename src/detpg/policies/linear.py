"""mu_theta(s) = theta s, or theta x(s): policies that are linear in the observation or features."""

import dataclasses

import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from detpg.types import Action, Features, Observation


@dataclasses.dataclass(frozen=True)
class LinearPolicy:
    """mu_theta(s) = theta s, theta an m by d matrix.

    Attributes:
        observation_size: d.
        action_size: m.
    """

    observation_size: int
    action_size: int

    def init(self, key: PRNGKeyArray) -> Float[Array, "act obs"]:
        """Zero parameters theta."""
        return jnp.zeros((self.action_size, self.observation_size))

    def __call__(self, theta: Float[Array, "act obs"], observation: Observation) -> Action:
        return jnp.dot(theta, observation, precision="highest")


@dataclasses.dataclass(frozen=True)
class FeaturePolicy:
    """mu_theta(s) = theta x(s), theta an m by n matrix, x any features.

    Attributes:
        features: x.
        action_size: m.
    """

    features: Features
    action_size: int

    def init(self, key: PRNGKeyArray) -> Float[Array, "act feat"]:
        """Zero parameters theta."""
        return jnp.zeros((self.action_size, self.features.size))

    def __call__(self, theta: Float[Array, "act feat"], observation: Observation) -> Action:
        return jnp.dot(theta, self.features(observation), precision="highest")
