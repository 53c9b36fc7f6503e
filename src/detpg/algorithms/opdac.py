"""OPDAC: the off-policy deterministic actor-critic with a Q-learning critic (Section 4.2)."""

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray, PyTree

from detpg import trees
from detpg.actors.deterministic import deterministic_direction
from detpg.algorithms.parts import behaviour, checked, incompatible_parts, incremental, validate
from detpg.critics.td import td_error
from detpg.types import (
    Action,
    ActionValue,
    Bounds,
    EnvironmentSpec,
    Number,
    Observation,
    Policy,
    Transition,
    Width,
    hyper,
    of_episode,
)


class OPDACState(eqx.Module):
    """theta of the actor, w of the critic; the last action's deviation from mu_theta."""

    theta: PyTree
    w: PyTree
    deviation: Action = of_episode()


class OPDACInfo(eqx.Module):
    """Diagnostics of one update: the TD error and the value of the action taken."""

    delta: Number
    value: Number


class OPDAC(eqx.Module):
    """OPDAC, eq. 16-18: Q-learning critic, actor along grad_a Q^w at mu_theta(s).

    Attributes:
        policy: mu_theta (static).
        action_value: Q^w (static).
        bounds: Of the legal actions; only their number m is read (static).
        gamma: Discount factor.
        alpha_theta: Step size of the actor.
        alpha_w: Step size of the critic.
        sigma: Standard deviation of the behaviour, one number or one for each action component;
            any other behaviour may be learnt from.
        correlation: Of its noise from one step to the next.
    """

    equations: ClassVar[str] = "16, 17, 18"
    experience = incremental

    policy: Policy = eqx.field(static=True)
    action_value: ActionValue = eqx.field(static=True)
    bounds: Bounds = eqx.field(static=True)
    gamma: Number = hyper("discount factor", 0.99, 0.0, 1.0)
    alpha_theta: Number = hyper("step size of the actor", 1e-3, 0.0, 1e6)
    alpha_w: Number = hyper("step size of the critic", 1e-2, 0.0, 1e6)
    sigma: Width = hyper("standard deviation of the behaviour, action units", 0.1, 0.0, 1e6)
    correlation: Number = hyper("of the noise from step to step; 0: white", 0.0, 0.0, 0.999999)

    def __check_init__(self):
        validate(self)

    @classmethod
    def create(cls, spec: EnvironmentSpec, **options: Any) -> "OPDAC":
        """The learner for an environment; a linear policy and a quadratic critic unless given."""
        parts = incompatible_parts(spec) | {"bounds": spec.bounds}
        return cls(**checked(spec, parts | options))

    def init(self, key: PRNGKeyArray) -> OPDACState:
        theta_key, w_key = jax.random.split(key)
        theta, w = self.policy.init(theta_key), self.action_value.init(w_key)
        return OPDACState(theta, w, deviation=jnp.zeros(len(self.bounds.low)))

    def act(self, key: PRNGKeyArray, state: OPDACState, observation: Observation) -> Action:
        # a ~ beta(.|s), here N(mu_theta(s), sigma^2)
        return behaviour(self).act(key, state.theta, observation, state.deviation)

    def update(
        self, key: PRNGKeyArray, state: OPDACState, transition: Transition
    ) -> tuple[OPDACState, OPDACInfo]:
        theta, w = state.theta, state.w
        s, a, next_s = transition.observation, transition.action, transition.next_observation

        # delta = r + gamma Q^w(s', mu_theta(s')) - Q^w(s, a)  (16)
        value, gradient = jax.value_and_grad(self.action_value)(w, s, a)
        next_value = self.action_value(w, next_s, self.policy(theta, next_s))
        delta = td_error(transition.reward, self.gamma, transition.terminated, next_value, value)

        # w <- w + alpha_w delta grad_w Q^w(s, a)  (17)
        next_w = trees.add_scaled(w, self.alpha_w * delta, gradient)

        # theta <- theta + alpha_theta grad_theta mu_theta(s) grad_a Q^w(s, a) at mu_theta(s)  (18)
        direction = deterministic_direction(
            self.policy, theta, s, lambda action: self.action_value(w, s, action)
        )
        deviation = behaviour(self).deviation(theta, transition)
        theta = trees.add_scaled(theta, self.alpha_theta, direction)
        return OPDACState(theta, next_w, deviation), OPDACInfo(delta=delta, value=value)

    def greedy(self, state: OPDACState, observation: Observation) -> Action:
        return self.policy(state.theta, observation)
