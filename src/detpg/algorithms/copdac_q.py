"""COPDAC-Q: the compatible deterministic actor-critic with a Q-learning critic (Section 4.3)."""

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray, PyTree

from detpg import trees
from detpg.actors.compatible import compatible_direction
from detpg.algorithms.parts import behaviour, checked, compatible_parts, incremental, seen, validate
from detpg.critics.td import td_error
from detpg.features.compatible import compatible_features
from detpg.types import (
    Action,
    Bounds,
    EnvironmentSpec,
    Number,
    Observation,
    Policy,
    StateValue,
    Transition,
    Width,
    hyper,
    of_episode,
    switch,
)


class COPDACQState(eqx.Module):
    """theta of the actor; w (shaped like theta) and v of the critic; the last a - mu_theta(s)."""

    theta: PyTree
    w: PyTree
    v: PyTree
    deviation: Action = of_episode()


class COPDACQInfo(eqx.Module):
    """Diagnostics of one update: the TD error, the state value, the advantage of the action."""

    delta: Number
    value: Number
    advantage: Number


class COPDACQ(eqx.Module):
    """COPDAC-Q, eq. 19-22: Q(s, a) = phi(s, a)^T w + V^v(s), phi = grad mu_theta(s) (a - mu).

    Attributes:
        policy: mu_theta (static).
        state_value: V^v, any differentiable baseline (static).
        bounds: Of the legal actions (static).
        capped, natural: As their fields say (static).
        gamma: Discount factor.
        alpha_theta: Step size of the actor.
        alpha_w: Step size of the advantage; scales like 1 / sigma^2.
        alpha_v: Step size of the state value.
        sigma: Width of the behaviour; one for each action component: docs/decisions/0018.
        correlation: Of its noise from one step to the next.
    """

    equations: ClassVar[str] = "19, 20, 21, 22; natural: end of Section 4.3"
    experience = incremental

    policy: Policy = eqx.field(static=True)
    state_value: StateValue = eqx.field(static=True)
    bounds: Bounds = eqx.field(static=True)
    capped: bool = switch("the critic sees the action as capped by the world, not as drawn", False)
    natural: bool = switch("the actor follows w itself, the natural gradient, not eq. 20", False)
    gamma: Number = hyper("discount factor", 0.99, 0.0, 1.0)
    alpha_theta: Number = hyper("step size of the actor", 1e-3, 0.0, 1e6)
    alpha_w: Number = hyper("step size of the advantage", 1e-1, 0.0, 1e6)
    alpha_v: Number = hyper("step size of the state value", 1e-2, 0.0, 1e6)
    sigma: Width = hyper("width of the behaviour, action units; 0: phi is 0", 0.3, 0.0, 1e6)
    correlation: Number = hyper("of the noise from step to step; 0: white", 0.0, 0.0, 0.999999)

    def __check_init__(self):
        validate(self)

    @classmethod
    def create(cls, spec: EnvironmentSpec, **options: Any) -> "COPDACQ":
        """The learner for an environment; linear policy and quadratic value unless given."""
        return cls(**checked(spec, compatible_parts(spec) | options))

    def init(self, key: PRNGKeyArray) -> COPDACQState:
        theta_key, v_key = jax.random.split(key)
        theta, v = self.policy.init(theta_key), self.state_value.init(v_key)
        deviation = jnp.zeros(len(self.bounds.low))
        return COPDACQState(theta, trees.zeros_like(theta), v, deviation)

    def act(self, key: PRNGKeyArray, state: COPDACQState, observation: Observation) -> Action:
        # a ~ beta(.|s) = N(mu_theta(s), sigma^2)
        return behaviour(self).act(key, state.theta, observation, state.deviation)

    def update(
        self, key: PRNGKeyArray, state: COPDACQState, transition: Transition
    ) -> tuple[COPDACQState, COPDACQInfo]:
        theta, w, v = state.theta, state.w, state.v
        s, a, next_s = seen(self, transition)
        phi = compatible_features(self.policy, theta, s, a)
        value, phi_v = jax.value_and_grad(self.state_value)(v, s)

        # delta = r + gamma Q(s', mu_theta(s')) - Q(s, a); phi(s', mu_theta(s')) = 0  (19)
        advantage, next_value = trees.dot(phi, w), self.state_value(v, next_s)
        r, end = transition.reward, transition.terminated
        delta = td_error(r, self.gamma, end, next_value, value + advantage)
        # theta <- theta + alpha_theta grad mu (grad mu^T w), or along w itself  (20)
        deviation = behaviour(self).deviation(theta, transition)
        direction = w if self.natural else compatible_direction(self.policy, theta, s, w)
        theta = trees.add_scaled(theta, self.alpha_theta, direction)
        # w <- w + alpha_w delta phi(s, a)  (21)
        w = trees.add_scaled(w, self.alpha_w * delta, phi)
        # v <- v + alpha_v delta phi(s), phi(s) = grad_v V^v(s)  (22)
        v = trees.add_scaled(v, self.alpha_v * delta, phi_v)
        return COPDACQState(theta, w, v, deviation), COPDACQInfo(delta, value, advantage)

    def greedy(self, state: COPDACQState, observation: Observation) -> Action:
        return self.policy(state.theta, observation)
