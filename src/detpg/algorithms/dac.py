"""DAC: the on-policy deterministic actor-critic with a Sarsa critic (Section 4.1)."""

from typing import Any, ClassVar

import equinox as eqx
import jax
from jaxtyping import PRNGKeyArray, PyTree

from detpg import trees
from detpg.actors.deterministic import deterministic_direction
from detpg.algorithms.parts import (
    check_moves,
    checked,
    incompatible_parts,
    incremental,
    network,
    validate,
)
from detpg.critics.td import td_error
from detpg.types import (
    Action,
    ActionValue,
    EnvironmentSpec,
    Number,
    Observation,
    Policy,
    Transition,
    hyper,
)


class DACState(eqx.Module):
    """theta of the actor, w of the critic."""

    theta: PyTree
    w: PyTree


class DACInfo(eqx.Module):
    """Diagnostics of one update: the TD error and the value of the action taken."""

    delta: Number
    value: Number


class DAC(eqx.Module):
    """DAC, eq. 11-13: Sarsa critic, actor along grad_a Q^w at mu_theta(s).

    Attributes:
        policy: mu_theta (static).
        action_value: Q^w (static).
        gamma: Discount factor.
        alpha_theta: Step size of the actor.
        alpha_w: Step size of the critic.
    """

    equations: ClassVar[str] = "11, 12, 13"
    experience = incremental

    policy: Policy = eqx.field(static=True)
    action_value: ActionValue = eqx.field(static=True)
    gamma: Number = hyper("discount factor", 0.99, 0.0, 1.0)
    alpha_theta: Number = hyper("step size of the actor", 1e-3, 0.0, 1e6)
    alpha_w: Number = hyper("step size of the critic", 1e-2, 0.0, 1e6)

    def __check_init__(self):
        validate(self)

    @classmethod
    def create(cls, spec: EnvironmentSpec, **options: Any) -> "DAC":
        """The learner for an environment; a network and a quadratic critic unless given.

        Raises:
            ValueError: Parts that do not fit, or that would never leave where they start.
        """
        parts = checked(spec, incompatible_parts(spec) | {"policy": network(spec)} | options)
        check_moves(spec, parts)
        return cls(**parts)

    def init(self, key: PRNGKeyArray) -> DACState:
        theta_key, w_key = jax.random.split(key)
        return DACState(theta=self.policy.init(theta_key), w=self.action_value.init(w_key))

    def act(self, key: PRNGKeyArray, state: DACState, observation: Observation) -> Action:
        # a = mu_theta(s): what noise there is must come from the environment
        return self.policy(state.theta, observation)

    def update(
        self, key: PRNGKeyArray, state: DACState, transition: Transition
    ) -> tuple[DACState, DACInfo]:
        theta, w = state.theta, state.w
        s, a = transition.observation, transition.action

        # delta = r + gamma Q^w(s', a') - Q^w(s, a)  (11)
        value, gradient = jax.value_and_grad(self.action_value)(w, s, a)
        next_value = self.action_value(w, transition.next_observation, transition.next_action)
        delta = td_error(transition.reward, self.gamma, transition.terminated, next_value, value)

        # w <- w + alpha_w delta grad_w Q^w(s, a)  (12)
        next_w = trees.add_scaled(w, self.alpha_w * delta, gradient)

        # theta <- theta + alpha_theta grad_theta mu_theta(s) grad_a Q^w(s, a) at mu_theta(s)  (13)
        direction = deterministic_direction(
            self.policy, theta, s, lambda action: self.action_value(w, s, action)
        )
        theta = trees.add_scaled(theta, self.alpha_theta, direction)
        return DACState(theta, next_w), DACInfo(delta=delta, value=value)

    def greedy(self, state: DACState, observation: Observation) -> Action:
        return self.policy(state.theta, observation)
