"""DDPG: a critic and an actor with slow targets, on recalled batches (Lillicrap et al., 2016)."""

import dataclasses
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray, PyTree

from detpg import trees
from detpg.actors.deterministic import batch_direction
from detpg.algorithms import replay
from detpg.algorithms.replay import ReplayInfo, ReplayState
from detpg.critics.targets import n_step_target
from detpg.experience import Recalled
from detpg.policies.behaviour import cap
from detpg.policies.noise import ColouredNoise
from detpg.types import (
    Action,
    ActionValues,
    Bounds,
    EnvironmentSpec,
    Number,
    Observation,
    Policy,
    Transition,
    Width,
    hyper,
    switch,
)


class DDPG(eqx.Module):
    """DDPG: Q-learning with a target critic and a target actor; the actor along grad_a Q."""

    equations: ClassVar[str] = "none of the paper's: the algorithm of Lillicrap et al."
    experience = replay.recalled

    policy: Policy = eqx.field(static=True)
    action_values: ActionValues = eqx.field(static=True)
    noise: ColouredNoise = eqx.field(static=True)
    bounds: Bounds = eqx.field(static=True)
    memory: int = switch("transitions that are remembered", 1_000_000)
    batch: int = switch("transitions of an update", 128)
    warm_up: int = switch("steps of random actions before the first update", 1_000)
    updates: int = switch("for each step of the world", 1)
    n: int = switch("steps whose rewards are summed before bootstrapping", 1)
    gamma: Number = hyper("discount factor", 0.99, 0.0, 1.0)
    alpha_theta: Number = hyper("step size of the actor", 1e-3, 0.0, 1.0)
    alpha_w: Number = hyper("step size of the critics", 1e-3, 0.0, 1.0)
    tau: Number = hyper("share of a target that is renewed at each update", 0.005, 0.0, 1.0)
    sigma: Width = hyper("standard deviation of exploration, units of the box", 0.5, 0.0, 1e6)
    colour: Number = hyper("of that noise: 0 white, 1 pink, 2 red", 1.0, 0.0, 4.0)

    def __check_init__(self):
        replay.validate_replay(self)

    @classmethod
    def create(cls, spec: EnvironmentSpec, **options: Any) -> "DDPG":
        """The learner for an environment; networks of 128-128 unless given."""
        return cls(**replay.replay_parts(spec, critics=1) | options)

    def init(self, key: PRNGKeyArray) -> ReplayState:
        return replay.begin(self, key)

    def act(self, key: PRNGKeyArray, state: ReplayState, observation: Observation) -> Action:
        return replay.explore(self, state, observation)  # a = mu_theta(s) + e

    def roam(self, key: PRNGKeyArray, state: ReplayState, observation: Observation) -> Action:
        return replay.roam(self, state)  # until there is enough to learn from

    def follow(self, key: PRNGKeyArray, state: ReplayState, transition: Transition) -> ReplayState:
        noise = self.noise.next(key, self.colour, state.noise, transition.ended)
        return dataclasses.replace(state, noise=noise)

    def update(
        self, key: PRNGKeyArray, state: ReplayState, transition: Recalled
    ) -> tuple[ReplayState, ReplayInfo]:
        theta, s = state.theta, transition.observation
        values = jax.vmap(self.action_values, in_axes=(None, 0, 0))

        # y = r + gamma Q_w'(s', mu_theta'(s'))
        a = replay.acted(self, state.target_theta, transition.next_observation)
        next_value = values(state.target_w, transition.next_observation, a)[:, 0]
        y = n_step_target(transition, self.gamma, next_value)

        # w <- argmin mean (y - Q_w(s, a))^2
        def loss(w: PyTree) -> tuple[Number, Float[Array, "batch critics"]]:
            value = values(w, s, transition.action)
            return jnp.mean(jnp.sum((y[:, None] - value) ** 2, axis=1)), value

        gradient, value = jax.grad(loss, has_aux=True)(state.w)
        w, critic_adam = replay.adam(state.w, gradient, state.critic_optimiser, -self.alpha_w)

        # theta <- theta + alpha mean grad mu_theta(s) grad_a Q_w(s, a)
        direction = batch_direction(self.policy, theta, s, replay.slopes_at(self, w, s))
        theta, actor_adam = replay.adam(theta, direction, state.actor_optimiser, self.alpha_theta)

        # theta' <- tau theta + (1 - tau) theta', likewise w'
        targets = (
            trees.polyak(state.target_theta, self.tau, theta),
            trees.polyak(state.target_w, self.tau, w),
        )
        updates = state.updates + 1
        after = ReplayState(theta, w, *targets, actor_adam, critic_adam, updates, state.noise)
        return after, replay.info(y, value)

    def greedy(self, state: ReplayState, observation: Observation) -> Action:
        return cap(self.policy(state.theta, observation), self.bounds)
