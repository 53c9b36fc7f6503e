"""beta: the behaviours that explore around a deterministic policy."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray, PyTree

from detpg.types import Action, Number, Observation, Policy


class GaussianBehaviour(eqx.Module):
    """beta(a|s) = N(mu_theta(s), sigma^2 I): fixed-width Gaussian noise (Section 5.1).

    Attributes:
        policy: mu_theta (static).
        sigma: Standard deviation of each action component, action units.
    """

    policy: Policy = eqx.field(static=True)
    sigma: Float[Array, ""]

    def act(self, key: PRNGKeyArray, theta: PyTree, observation: Observation) -> Action:
        mean = self.policy(theta, observation)
        return mean + self.sigma * jax.random.normal(key, mean.shape, mean.dtype)

    def log_prob(self, theta: PyTree, observation: Observation, action: Action) -> Number:
        """Natural logarithm of the density, per unit of action volume."""
        error = (action - self.policy(theta, observation)) / self.sigma
        normaliser = error.size * jnp.log(2 * jnp.pi * self.sigma**2)
        return -0.5 * (jnp.sum(error**2) + normaliser)
