"""pi_{theta,y}(a|s) = N(mu_theta(s), exp(y) I): the isotropic Gaussian policy of Section 5.1."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray, PyTree

from detpg.types import Action, Number, Observation, Policy


class GaussianParameters(eqx.Module):
    """theta (of the mean) and y (the logarithm of the variance, one number)."""

    theta: PyTree
    y: Float[Array, ""]


@dataclasses.dataclass(frozen=True)
class IsotropicGaussian:
    """N(mu_theta(s), exp(y) I), with mu_theta any deterministic policy.

    exp(y) is the *variance*: Section 5.1 writes N(theta, exp(y)) beside N(theta, sigma_beta^2).
    The parameters of this policy are the pair (theta, y), one pytree.

    Attributes:
        mean: mu_theta.
    """

    mean: Policy

    def init(self, key: PRNGKeyArray) -> GaussianParameters:
        """The parameters theta of the mean policy, and y = 0 (variance 1)."""
        return GaussianParameters(theta=self.mean.init(key), y=jnp.zeros(()))

    def __call__(self, theta: GaussianParameters, observation: Observation) -> Action:
        return self.mean(theta.theta, observation)

    def sample(
        self, key: PRNGKeyArray, theta: GaussianParameters, observation: Observation
    ) -> Action:
        mean = self(theta, observation)
        return mean + jnp.exp(theta.y / 2) * jax.random.normal(key, mean.shape, mean.dtype)

    def log_prob(
        self, theta: GaussianParameters, observation: Observation, action: Action
    ) -> Number:
        """Natural logarithm of the density, per unit of action volume."""
        error = action - self(theta, observation)
        squares = jnp.sum(error**2) * jnp.exp(-theta.y)
        return -0.5 * (squares + error.size * (theta.y + jnp.log(2 * jnp.pi)))
