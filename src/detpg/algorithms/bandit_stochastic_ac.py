"""SAC-B: the stochastic actor-critic on a bandit (Section 5.1). Not Soft Actor-Critic."""

from typing import Any, ClassVar, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray, PyTree

from detpg import trees
from detpg.actors.stochastic import likelihood_ratio_direction
from detpg.algorithms.parts import validate
from detpg.critics.regression import linear_regression
from detpg.experience import Experience
from detpg.features.compatible import score
from detpg.policies.constant import ConstantPolicy
from detpg.policies.gaussian import GaussianParameters, IsotropicGaussian
from detpg.types import Action, EnvironmentSpec, Number, Observation, Transition, hyper, switch

Actor = Literal["score-times-q", "score-times-advantage"]


class BanditStochasticACState(eqx.Module):
    """theta and y, the parameters of pi_{theta,y}."""

    parameters: GaussianParameters


class BanditStochasticACInfo(eqx.Module):
    """Diagnostics: the critic's bias, which is the reward expected of the policy; its width."""

    value: Number
    sigma: Number


class BanditStochasticAC(eqx.Module):
    """SAC-B, Section 5.1: N(theta, exp(y)), with mean and variance adapted along eq. 2.

    Attributes:
        policy: pi_{theta,y} (static).
        actor: What the score is multiplied by (static). "score-times-q": phi^T w + bias, whose
            batch mean equals that of the raw reward, so that the learner is REINFORCE; this fits
            the published curve. "score-times-advantage": phi^T w alone, the bias is a baseline.
        fixed_variance: Adapt the mean only (static): the control of Section 5.1.
        alpha_theta, alpha_y: Step sizes of the mean and of the log-variance.
        sigma: Initial standard deviation, y_0 = 2 log sigma.
    """

    equations: ClassVar[str] = "Section 5.1; 2, 3"

    policy: IsotropicGaussian = eqx.field(static=True)
    actor: Actor = switch("what the score is multiplied by", "score-times-q")
    fixed_variance: bool = switch("adapt the mean alone, not the variance", False)
    alpha_theta: Number = hyper("step size of the mean", 0.01, 0.0, 1e6)
    alpha_y: Number = hyper("step size of the log-variance", 0.001, 0.0, 1e6)
    sigma: Number = hyper("initial standard deviation, action units", 1.0, 1e-6, 1e6)

    def __check_init__(self):
        validate(self)

    @classmethod
    def create(cls, spec: EnvironmentSpec, **options: Any) -> "BanditStochasticAC":
        """The learner for an environment, with the mean theta."""
        return cls(policy=IsotropicGaussian(ConstantPolicy(spec.action_size)), **options)

    @property
    def experience(self) -> Experience:
        """2m steps, as for COPDAC-B."""
        return Experience("fresh", batch=2 * trees.num_parameters(self.policy.mean))

    def init(self, key: PRNGKeyArray) -> BanditStochasticACState:
        theta = self.policy.mean.init(key)
        return BanditStochasticACState(GaussianParameters(theta, y=2 * jnp.log(self.sigma)))

    def act(
        self, key: PRNGKeyArray, state: BanditStochasticACState, observation: Observation
    ) -> Action:
        # a ~ pi_{theta,y}(.) = N(theta, exp(y))
        return self.policy.sample(key, state.parameters, observation)

    def update(
        self, key: PRNGKeyArray, state: BanditStochasticACState, transition: Transition
    ) -> tuple[BanditStochasticACState, BanditStochasticACInfo]:
        theta, y = state.parameters.theta, state.parameters.y
        # phi(a) = grad log pi_{theta,y}(a), for each a of the batch and each adapted parameter
        phi = jax.vmap(self._score, in_axes=(None, 0, 0))(
            state.parameters, transition.observation, transition.action
        )
        # w, bias: least squares of the rewards on phi and a bias feature
        features = jax.vmap(trees.to_vector)(phi)
        critic = linear_regression(features, transition.reward)

        # theta, y <- theta, y + alpha grad log pi_{theta,y}(a) Q^w(a), batch mean  (2, 3)
        value = jax.vmap(critic)(features)
        if self.actor == "score-times-advantage":
            value = value - critic.bias
        direction = trees.mean(jax.vmap(likelihood_ratio_direction)(phi, value))
        new = GaussianParameters(
            theta=trees.add_scaled(theta, self.alpha_theta, direction["theta"]),
            y=y if self.fixed_variance else y + self.alpha_y * direction["y"],
        )
        info = BanditStochasticACInfo(value=critic.bias, sigma=jnp.exp(y / 2))
        return BanditStochasticACState(new), info

    def _score(
        self, parameters: GaussianParameters, observation: Observation, action: Action
    ) -> dict[str, PyTree]:
        gradient = score(self.policy, parameters, observation, action)
        adapted = {"theta": gradient.theta}
        return adapted if self.fixed_variance else adapted | {"y": gradient.y}

    def greedy(self, state: BanditStochasticACState, observation: Observation) -> Action:
        return self.policy(state.parameters, observation)
