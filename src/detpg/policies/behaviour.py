"""beta: the behaviours that explore around a deterministic policy."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray, PyTree

from detpg.types import Action, Bounds, Number, Observation, Policy, Transition, strong


class GaussianBehaviour(eqx.Module):
    """beta(a|s) = N(mu_theta(s), diag(sigma^2)): Gaussian noise of fixed width (Section 5.1).

    With a correlation above 0 the noise is an Ornstein-Uhlenbeck process seen once a step: e' =
    correlation e + sqrt(1 - correlation^2) sigma xi, of the same width in the long run. It starts
    from 0 in each episode: the first action has width sigma sqrt(1 - correlation^2). sigma = 0 is
    no noise at all, and has no density: `log_prob` is then nan.

    Attributes:
        policy: mu_theta (static).
        sigma: Standard deviation, action units: one number, or one for each action component.
        correlation: Of the noise from one step to the next; exp(-rate * time step).
    """

    policy: Policy = eqx.field(static=True)
    sigma: Float[Array, "..."]
    correlation: Number = eqx.field(default=0.0, converter=strong)

    def act(
        self,
        key: PRNGKeyArray,
        theta: PyTree,
        observation: Observation,
        deviation: Float[Array, "act"] | None = None,
    ) -> Action:
        """An action; `deviation` is that of the action before.

        When it is not given the noise is white, of full width sigma: that of the long run.
        """
        mean = self.policy(theta, observation)
        noise = self.sigma * jax.random.normal(key, mean.shape, mean.dtype)
        if deviation is None:
            return mean + noise
        fresh = jnp.sqrt(1 - self.correlation**2)
        return mean + (self.correlation * deviation + fresh * noise)

    def deviation(self, theta: PyTree, transition: Transition) -> Float[Array, "act"]:
        """What the next noise is correlated with: a - mu_theta(s), or 0 at an episode's end."""
        deviation = transition.action - self.policy(theta, transition.observation)
        return jnp.where(transition.ended, jnp.zeros_like(deviation), deviation)

    def log_prob(self, theta: PyTree, observation: Observation, action: Action) -> Number:
        """Natural logarithm of the density in the long run, per unit of action volume."""
        error = (action - self.policy(theta, observation)) / self.sigma
        widths = jnp.broadcast_to(self.sigma, error.shape)
        return -0.5 * jnp.sum(error**2 + jnp.log(2 * jnp.pi * widths**2))


def cap(action: Action, bounds: Bounds) -> Action:
    """The legal action nearest to a given one: what a world with these bounds carries out."""
    low, high = (jnp.asarray(bound, dtype=action.dtype) for bound in bounds)
    return jnp.clip(action, low, high)
