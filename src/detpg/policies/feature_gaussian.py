"""pi_u(a|s): a Gaussian whose mean and width are read from features (Degris et al., 2012)."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from detpg.policies.linear import FeaturePolicy
from detpg.types import Action, Features, Number, Observation

LEAST_WIDTH = 1e-7  # keeps the density finite where exp underflows


class MeanAndWidth(eqx.Module):
    """u: weights of the mean and of the logarithm of the width; also their traces and gradients."""

    mean: Float[Array, "act feat"]
    width: Float[Array, "act feat"]


class FeatureGaussian(eqx.Module):
    """N(mu, sigma^2) for each component, mu = u_mean x, sigma = sigma0 exp(u_width x) + 1e-7.

    sigma is a standard deviation, as in the authors' library RLPark; the paper writes
    N(theta phi, exp(y phi)) and does not say which (docs/decisions/0016).

    Attributes:
        features: x (static).
        action_size: m (static).
        sigma0: Standard deviation of each component where u_width is 0, action units.
    """

    features: Features = eqx.field(static=True)
    action_size: int = eqx.field(static=True)
    sigma0: Number

    def init(self, key: PRNGKeyArray) -> MeanAndWidth:
        """Zero weights u."""
        zeros = jnp.zeros((self.action_size, self.features.size))
        return MeanAndWidth(mean=zeros, width=zeros)

    @property
    def mean(self) -> FeaturePolicy:
        """mu, whose theta is u_mean."""
        return FeaturePolicy(self.features, self.action_size)

    def __call__(self, theta: MeanAndWidth, observation: Observation) -> Action:
        return self.mean(theta.mean, observation)

    def sigma(self, theta: MeanAndWidth, observation: Observation) -> Float[Array, "act"]:
        """Standard deviation of each action component."""
        exponent = jnp.dot(theta.width, self.features(observation), precision="highest")
        return self.sigma0 * jnp.exp(exponent) + LEAST_WIDTH

    def sample(self, key: PRNGKeyArray, theta: MeanAndWidth, observation: Observation) -> Action:
        mean = self(theta, observation)
        noise = jax.random.normal(key, mean.shape, mean.dtype)
        return mean + self.sigma(theta, observation) * noise

    def log_prob(self, theta: MeanAndWidth, observation: Observation, action: Action) -> Number:
        """Natural logarithm of the density, per unit of action volume."""
        sigma = self.sigma(theta, observation)
        error = (action - self(theta, observation)) / sigma
        return -0.5 * jnp.sum(error**2 + jnp.log(2 * jnp.pi * sigma**2))
