"""COPDAC-B: the compatible deterministic actor-critic on a bandit (Section 5.1)."""

from typing import Any, ClassVar

import equinox as eqx
import jax
from jaxtyping import Array, Float, PRNGKeyArray, PyTree

from detpg import trees
from detpg.actors.compatible import compatible_direction
from detpg.critics.regression import linear_regression
from detpg.experience import Experience
from detpg.features.compatible import compatible_features
from detpg.policies.behaviour import GaussianBehaviour
from detpg.policies.constant import ConstantPolicy
from detpg.types import (
    Action,
    EnvironmentSpec,
    Number,
    Observation,
    Policy,
    Transition,
    check_hyper,
    hyper,
)


class BanditCOPDACState(eqx.Module):
    """theta, the parameters of mu_theta."""

    theta: PyTree


class BanditCOPDACInfo(eqx.Module):
    """Diagnostics of one update.

    Attributes:
        value: Bias of the critic: the reward expected of the mean action.
        slope: w, the critic's estimate of the action-value gradient.
    """

    value: Number
    slope: Float[Array, "feat"]


class BanditCOPDAC(eqx.Module):
    """COPDAC-B, Section 5.1: Q(a) by regression on compatible features, then one actor step.

    Maximises reward; the paper's box fits costs and descends, which is the same step.

    Attributes:
        policy: mu_theta; theta itself in the paper (static).
        alpha_theta: Step size of the actor.
        sigma: Standard deviation sigma_beta of the behaviour.
    """

    equations: ClassVar[str] = "Section 5.1; 20"

    policy: Policy = eqx.field(static=True)
    alpha_theta: Number = hyper("step size of the actor", 0.1, 0.0, 1e6)
    sigma: Number = hyper("standard deviation of the behaviour, action units", 0.1, 1e-6, 1e6)

    def __check_init__(self):
        check_hyper(self)

    @classmethod
    def create(cls, spec: EnvironmentSpec, **options: Any) -> "BanditCOPDAC":
        """The learner for an environment, with mu_theta = theta."""
        return cls(policy=ConstantPolicy(spec.action_size), **options)

    @property
    def experience(self) -> Experience:
        """2m steps: each batch has twice as many samples as the critic has slopes."""
        return Experience("fresh", batch=2 * trees.num_parameters(self.policy))

    def init(self, key: PRNGKeyArray) -> BanditCOPDACState:
        return BanditCOPDACState(theta=self.policy.init(key))

    def act(self, key: PRNGKeyArray, state: BanditCOPDACState, observation: Observation) -> Action:
        # a ~ beta(.) = N(mu_theta, sigma_beta^2)
        return GaussianBehaviour(self.policy, self.sigma).act(key, state.theta, observation)

    def update(
        self, key: PRNGKeyArray, state: BanditCOPDACState, transition: Transition
    ) -> tuple[BanditCOPDACState, BanditCOPDACInfo]:
        theta = state.theta

        # phi(a) = grad_theta mu_theta (a - mu_theta), for each a of the batch
        phi = jax.vmap(lambda s, a: compatible_features(self.policy, theta, s, a))(
            transition.observation, transition.action
        )
        # w, bias: least squares of the rewards on phi and a bias feature
        critic = linear_regression(jax.vmap(trees.to_vector)(phi), transition.reward)
        w = trees.like(theta, critic.w)

        # theta <- theta + alpha_theta grad_theta mu_theta (grad_theta mu_theta^T w)  (20)
        direction = jax.vmap(lambda s: compatible_direction(self.policy, theta, s, w))(
            transition.observation
        )
        theta = trees.add_scaled(theta, self.alpha_theta, trees.mean(direction))
        return BanditCOPDACState(theta), BanditCOPDACInfo(value=critic.bias, slope=critic.w)

    def greedy(self, state: BanditCOPDACState, observation: Observation) -> Action:
        return self.policy(state.theta, observation)
