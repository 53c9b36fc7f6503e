"""stochastic-ac: the on-policy stochastic actor-critic (Section 5.2's SAC; Degris et al., 2012)."""

from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from detpg import trees
from detpg.actors.stochastic import Gradient, gaussian_score
from detpg.algorithms.parts import feature_gaussian, feature_parts, incremental, validate
from detpg.critics.td import td_error
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
    switch,
)


class StochasticACState(eqx.Module):
    """u of the actor, v of the critic, and their traces."""

    u: MeanAndWidth
    v: Float[Array, "feat"]
    e_u: MeanAndWidth = of_episode()
    e_v: Float[Array, "feat"] = of_episode()


class StochasticACInfo(eqx.Module):
    """Diagnostics of one update: the TD error, the state value, the policy's mean width."""

    delta: Number
    value: Number
    sigma: Number


class StochasticAC(eqx.Module):
    """The stochastic actor-critic: pi_u a Gaussian on features, TD(lambda) critic V^v (eq. 2, 3).

    The value that multiplies the score is the TD error: Q(s, a) less the baseline V(s).

    Attributes:
        features: x(s), of the mean, the width and the value (static).
        action_size: m (static).
        gradient, fixed_std: As their fields say (static).
        gamma: Discount factor.
        lambda_: Trace decay of actor and critic; 0: no traces.
        alpha_u: Step size of the mean.
        alpha_y: Step size of the width; the authors' library uses one for both.
        alpha_v: Step size of the critic.
        sigma0: Standard deviation of the policy at the start.
    """

    equations: ClassVar[str] = "2, 3"
    experience, policy = incremental, feature_gaussian

    features: Features = eqx.field(static=True)
    action_size: int = eqx.field(static=True)
    gradient: Gradient = switch("of the Gaussian: plain, or scaled by sigma^2", "plain")
    fixed_std: bool = switch("leave the width at sigma0", False)
    gamma: Number = hyper("discount factor", 0.99, 0.0, 1.0)
    lambda_: Number = hyper("trace decay; 0: no traces", 0.0, 0.0, 1.0)
    alpha_u: Number = hyper("step size of the mean", 2e-4, 0.0, 1e6)
    alpha_y: Number = hyper("step size of the width", 1e-5, 0.0, 1e6)
    alpha_v: Number = hyper("step size of the critic", 1e-2, 0.0, 1e6)
    sigma0: Number = hyper("standard deviation at the start, action units", 0.3, 1e-6, 1e6)

    def __check_init__(self):
        validate(self)

    @classmethod
    def create(cls, spec: EnvironmentSpec, **options: Any) -> "StochasticAC":
        """The learner for an environment; quadratic features unless given."""
        return cls(**feature_parts(spec, options))

    def init(self, key: PRNGKeyArray) -> StochasticACState:
        u, v = self.policy.init(key), jnp.zeros(self.features.size)
        return StochasticACState(u, v, e_u=trees.zeros_like(u), e_v=trees.zeros_like(v))

    def act(self, key: PRNGKeyArray, state: StochasticACState, observation: Observation) -> Action:
        return self.policy.sample(key, state.u, observation)

    def update(
        self, key: PRNGKeyArray, state: StochasticACState, transition: Transition
    ) -> tuple[StochasticACState, StochasticACInfo]:
        u, v = state.u, state.v
        s, a = transition.observation, transition.action
        x, next_x = self.features(s), self.features(transition.next_observation)
        sigma = self.policy.sigma(u, s)

        # delta = r + gamma v^T x(s') - v^T x(s)
        value, next_value = trees.dot(v, x), trees.dot(v, next_x)
        delta = td_error(transition.reward, self.gamma, transition.terminated, next_value, value)
        # e_v <- gamma lambda e_v + x;  v <- v + alpha_v delta e_v
        decay = self.gamma * self.lambda_
        e_v = trees.add_scaled(x, decay, state.e_v)
        v = trees.add_scaled(v, self.alpha_v * delta, e_v)
        # e_u <- gamma lambda e_u + grad_u log pi_u(a|s);  u <- u + alpha_u delta e_u  (2, 3)
        score = gaussian_score(x, a - self.policy(u, s), sigma, self.gradient)
        e_u = trees.add_scaled(MeanAndWidth(*score), decay, state.e_u)
        mean = trees.add_scaled(u.mean, self.alpha_u * delta, e_u.mean)
        width = trees.add_scaled(u.width, self.alpha_y * delta, e_u.width)
        u = MeanAndWidth(mean, u.width if self.fixed_std else width)
        # A trace ends with its episode, also where a time limit cuts it.
        e_u, e_v = trees.zero_where(transition.ended, (e_u, e_v))
        info = StochasticACInfo(delta, value, jnp.mean(sigma))
        return StochasticACState(u, v, e_u, e_v), info

    def greedy(self, state: StochasticACState, observation: Observation) -> Action:
        return self.policy(state.u, observation)
