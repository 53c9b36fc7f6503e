"""COPDAC-GQ: the compatible actor-critic with a gradient Q-learning critic (Section 4.3)."""

from typing import Any, ClassVar, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray, PyTree

from detpg import trees
from detpg.actors.compatible import compatible_direction
from detpg.algorithms.copdac_q import COPDACQInfo
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


class COPDACGQState(eqx.Module):
    """As COPDAC-Q's, with u and z, the auxiliary weights of w and v (z is 0 if `printed`)."""

    theta: PyTree
    w: PyTree
    v: PyTree
    u: PyTree
    z: PyTree
    deviation: Action = of_episode()


class COPDACGQ(eqx.Module):
    """COPDAC-GQ, eq. 23-27; psi = (phi(s, a); phi(s)), auxiliary weights h = (u; z).

    Attributes:
        policy, state_value, bounds, capped, natural: As in COPDAC-Q (static).
        correction: "full": GQ on all of psi (docs/decisions/0012); "printed": u alone (static).
        gamma, alpha_theta, alpha_w, alpha_v: Discount; steps of actor, advantage, state value.
        alpha_u: Step size of the auxiliary weights; alpha_u |psi|^2 must stay below 2.
        sigma, correlation: Of the behaviour's noise; unequal widths as in docs/decisions/0018.
    """

    equations: ClassVar[str] = "23, 24, 25, 26, 27; natural: end of Section 4.3"
    experience = incremental

    policy: Policy = eqx.field(static=True)
    state_value: StateValue = eqx.field(static=True)
    bounds: Bounds = eqx.field(static=True)
    capped: bool = switch("the critic sees the action as capped by the world, not as drawn", False)
    correction: Literal["full", "printed"] = switch("GQ of Q and V, or as printed", "full")
    natural: bool = switch("the actor follows w itself, the natural gradient, not eq. 24", False)
    gamma: Number = hyper("discount factor", 0.99, 0.0, 1.0)
    alpha_theta: Number = hyper("step size of the actor", 1e-3, 0.0, 1e6)
    alpha_w: Number = hyper("step size of the advantage", 1e-1, 0.0, 1e6)
    alpha_v: Number = hyper("step size of the state value", 1e-2, 0.0, 1e6)
    alpha_u: Number = hyper("step size of the auxiliary weights", 1e-2, 0.0, 1e6)
    sigma: Width = hyper("width of the behaviour, action units; 0: phi is 0", 0.3, 0.0, 1e6)
    correlation: Number = hyper("of the noise from step to step; 0: white", 0.0, 0.0, 0.999999)

    def __check_init__(self):
        validate(self)

    @classmethod
    def create(cls, spec: EnvironmentSpec, **options: Any) -> "COPDACGQ":
        """The learner for an environment; linear policy and quadratic value unless given."""
        return cls(**checked(spec, compatible_parts(spec) | options))

    def init(self, key: PRNGKeyArray) -> COPDACGQState:
        keys = jax.random.split(key)
        theta, v = self.policy.init(keys[0]), self.state_value.init(keys[1])
        w, u, z = map(trees.zeros_like, (theta, theta, v))
        return COPDACGQState(theta, w, v, u, z, deviation=jnp.zeros(len(self.bounds.low)))

    def act(self, key: PRNGKeyArray, state: COPDACGQState, observation: Observation) -> Action:
        # a ~ beta(.|s) = N(mu_theta(s), sigma^2)
        return behaviour(self).act(key, state.theta, observation, state.deviation)

    def update(
        self, key: PRNGKeyArray, state: COPDACGQState, transition: Transition
    ) -> tuple[COPDACGQState, COPDACQInfo]:
        theta, w, v, u, z = state.theta, state.w, state.v, state.u, state.z
        s, a, next_s = seen(self, transition)
        phi = compatible_features(self.policy, theta, s, a)
        value, phi_v = jax.value_and_grad(self.state_value)(v, s)
        next_value, next_phi_v = jax.value_and_grad(self.state_value)(v, next_s)

        # delta = r + gamma Q(s', mu_theta(s')) - Q(s, a); phi(s', mu_theta(s')) = 0  (23)
        advantage, end = trees.dot(phi, w), transition.terminated
        delta = td_error(transition.reward, self.gamma, end, next_value, value + advantage)
        # psi^T h, of which the paper keeps phi(s, a)^T u
        expected = trees.dot(phi, u) + trees.dot(phi_v, z)
        if self.correction == "full":
            z = trees.add_scaled(z, self.alpha_u * (delta - expected), phi_v)
        # theta <- theta + alpha_theta grad mu (grad mu^T w), or along w itself  (24)
        deviation = behaviour(self).deviation(theta, transition)
        direction = w if self.natural else compatible_direction(self.policy, theta, s, w)
        theta = trees.add_scaled(theta, self.alpha_theta, direction)
        # w <- w + alpha_w delta phi(s, a); its correction is a multiple of phi(s', mu) = 0  (25)
        w = trees.add_scaled(w, self.alpha_w * delta, phi)
        # v <- v + alpha_v delta phi(s) - alpha_v gamma phi(s') (psi^T h)  (26)
        v = trees.add_scaled(v, self.alpha_v * delta, phi_v)
        gamma = jnp.where(end, jnp.zeros_like(self.gamma), self.gamma)
        v = trees.add_scaled(v, -self.alpha_v * gamma * expected, next_phi_v)
        # u <- u + alpha_u (delta - psi^T h) phi(s, a)  (27)
        u = trees.add_scaled(u, self.alpha_u * (delta - expected), phi)
        return COPDACGQState(theta, w, v, u, z, deviation), COPDACQInfo(delta, value, advantage)

    def greedy(self, state: COPDACGQState, observation: Observation) -> Action:
        return self.policy(state.theta, observation)
