"""offpac: the off-policy stochastic actor-critic (Section 2.4; Degris, White & Sutton, 2012)."""

from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from detpg import trees
from detpg.actors.stochastic import gaussian_score
from detpg.algorithms.parts import feature_gaussian, feature_parts, incremental, validate
from detpg.critics.td import td_error
from detpg.policies.behaviour import GaussianBehaviour
from detpg.policies.feature_gaussian import MeanAndWidth
from detpg.types import (
    Action,
    EnvironmentSpec,
    Features,
    Number,
    Observation,
    Transition,
    hyper,
    of_episode,
)


class OffPACState(eqx.Module):
    """u of the actor, v of the critic, w the critic's auxiliary weights, and the traces."""

    u: MeanAndWidth
    v: Float[Array, "feat"]
    w: Float[Array, "feat"]
    e_u: MeanAndWidth = of_episode()
    e_v: Float[Array, "feat"] = of_episode()


class OffPACInfo(eqx.Module):
    """Diagnostics of one update: TD error, state value, importance ratio."""

    delta: Number
    value: Number
    rho: Number


class OffPAC(eqx.Module):
    """OffPAC: importance ratios, GTD(lambda) critic, Gaussian actor on features (eq. 4, 5).

    lambda_ = 0 and alpha_w = 0 give the setting of Section 5.2 (docs/decisions/0017).

    Attributes:
        features: x(s), of the mean, the width and the value (static).
        action_size: m (static).
        gamma, lambda_: Discount factor and trace decay (0: no traces).
        alpha_u, alpha_y: Step sizes of the mean and of the width.
        alpha_v, alpha_w: Step sizes of the critic and of its auxiliary weights.
        sigma0, sigma: Widths of the policy at the start and of the behaviour around its mean.
    """

    equations: ClassVar[str] = "4, 5"
    experience, policy = incremental, feature_gaussian

    features: Features = eqx.field(static=True)
    action_size: int = eqx.field(static=True)
    gamma: Number = hyper("discount factor", 0.99, 0.0, 1.0)
    lambda_: Number = hyper("trace decay; 0: no traces", 0.0, 0.0, 1.0)
    alpha_u: Number = hyper("step size of the mean", 2e-4, 0.0, 1e6)
    alpha_y: Number = hyper("step size of the width", 1e-5, 0.0, 1e6)
    alpha_v: Number = hyper("step size of the critic", 1e-2, 0.0, 1e6)
    alpha_w: Number = hyper("step size of the auxiliary weights", 0.0, 0.0, 1e6)
    sigma0: Number = hyper("standard deviation at the start, action units", 0.3, 1e-6, 1e6)
    sigma: Number = hyper("standard deviation of the behaviour, action units", 0.3, 1e-6, 1e6)

    def __check_init__(self):
        validate(self)

    @classmethod
    def create(cls, spec: EnvironmentSpec, **options: Any) -> "OffPAC":
        """The learner for an environment; quadratic features unless given."""
        return cls(**feature_parts(spec, options))

    def init(self, key: PRNGKeyArray) -> OffPACState:
        u, v = self.policy.init(key), jnp.zeros(self.features.size)
        return OffPACState(u, v, v, e_u=trees.zeros_like(u), e_v=trees.zeros_like(v))

    def act(self, key: PRNGKeyArray, state: OffPACState, observation: Observation) -> Action:
        return GaussianBehaviour(self.policy.mean, self.sigma).act(key, state.u.mean, observation)

    def update(
        self, key: PRNGKeyArray, state: OffPACState, transition: Transition
    ) -> tuple[OffPACState, OffPACInfo]:
        u, v, w = state.u, state.v, state.w
        s, a = transition.observation, transition.action
        x, next_x = self.features(s), self.features(transition.next_observation)
        mu, sigma = self.policy(u, s), self.policy.sigma(u, s)
        # rho = pi_u(a|s) / b(a|s), with the parameters before the update
        log_b = GaussianBehaviour(self.policy.mean, self.sigma).log_prob(u.mean, s, a)
        rho = jnp.exp(self.policy.log_prob(u, s, a) - log_b)

        # delta = r + gamma v^T x(s') - v^T x(s)
        value, next_value, end = trees.dot(v, x), trees.dot(v, next_x), transition.terminated
        delta = td_error(transition.reward, self.gamma, end, next_value, value)
        # e_v <- rho (x + gamma lambda e_v)
        e_v = rho * (x + self.gamma * self.lambda_ * state.e_v)
        # v <- v + alpha_v (delta e_v - gamma (1 - lambda) (w^T e_v) x(s'))
        gamma = jnp.where(end, jnp.zeros_like(self.gamma), self.gamma)
        correction = gamma * (1 - self.lambda_) * trees.dot(w, e_v)
        v = v + self.alpha_v * (delta * e_v - correction * next_x)
        # w <- w + alpha_w (delta e_v - (w^T x) x)
        w = w + self.alpha_w * (delta * e_v - trees.dot(w, x) * x)
        # e_u <- rho (grad_u log pi_u(a|s) + lambda e_u);  u <- u + alpha_u delta e_u  (4, 5)
        score = MeanAndWidth(*gaussian_score(x, a - mu, sigma, "plain"))
        e_u = trees.scale(rho, trees.add_scaled(score, self.lambda_, state.e_u))
        mean = trees.add_scaled(u.mean, self.alpha_u * delta, e_u.mean)
        u = MeanAndWidth(mean, trees.add_scaled(u.width, self.alpha_y * delta, e_u.width))
        # A trace ends with its episode, also where a time limit cuts it.
        e_u, e_v = trees.zero_where(transition.ended, (e_u, e_v))
        return OffPACState(u, v, w, e_u, e_v), OffPACInfo(delta, value, rho)

    def greedy(self, state: OffPACState, observation: Observation) -> Action:
        return self.policy(state.u, observation)
