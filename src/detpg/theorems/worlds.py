"""Worlds small enough that every quantity of Sections 2 and 3 can be computed."""

import dataclasses
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray, PyTree

from detpg import trees
from detpg.environments import LQR
from detpg.policies import MLPPolicy
from detpg.types import Action, EnvironmentSpec, Number, Observation, Policy


def regulator() -> tuple[LQR, Float[Array, "act obs"]]:
    """Three states, two actions, and a gain that is stable and not the best."""
    world = LQR(
        A=[[0.9, 0.3, 0.0], [-0.3, 0.9, 0.1], [0.0, 0.2, 0.7]],
        B=[[0.0, 0.2], [0.5, 0.0], [0.1, 0.6]],
        noise=0.3,
        start=1.0,
        gamma=0.8,
    )
    return world, jnp.asarray([[0.2, -0.4, 0.1], [-0.3, 0.1, -0.2]])


class Ring(eqx.Module):
    """Places on a circle; the action turns by about so many radians.

    p(s'|s, a) ~ exp(2 cos(x' - x - a)) and r(s, a) = cos(x - 1) + exp(-(a - sin x)^2) with x the
    angle of s: smooth in the action, in no power of it exact. The first state is uniform.

    Attributes:
        observations: What is seen in each place.
        gamma: Discount factor (static).
    """

    observations: Float[Array, "points obs"]
    gamma: float = eqx.field(static=True, default=0.8)

    @property
    def spec(self) -> EnvironmentSpec:
        bound, size = float("inf"), self.observations.shape[1]
        return EnvironmentSpec("ring", size, 1, (-bound,), (bound,), 200, self.gamma)

    def initial(self, key: PRNGKeyArray) -> Int[Array, ""]:
        return jax.random.randint(key, (), 0, self.num_states, dtype=int)

    def transition(
        self, key: PRNGKeyArray, state: Int[Array, ""], action: Action
    ) -> Int[Array, ""]:
        logits = jnp.log(self.chances(state, action))
        return jax.random.categorical(key, logits).astype(state.dtype)

    def reward(self, state: Int[Array, ""], action: Action, next_state: Int[Array, ""]) -> Number:
        x = self._angles[state]
        return jnp.cos(x - 1) + jnp.exp(-((action[0] - jnp.sin(x)) ** 2))

    def terminated(self, state: Int[Array, ""]) -> Bool[Array, ""]:
        return jnp.asarray(False)

    def observe(self, state: Int[Array, ""]) -> Observation:
        return self.observations[state]

    def chances(self, state: Int[Array, ""], action: Action) -> Float[Array, "points"]:
        """p(.|s, a)."""
        return jax.nn.softmax(2 * jnp.cos(self._angles - self._angles[state] - action[0]))

    @property
    def num_states(self) -> int:
        return self.observations.shape[0]

    @property
    def _angles(self) -> Float[Array, "points"]:
        return angles(self.num_states)


def angles(num_states: int) -> Float[Array, "points"]:
    """Where the places of a ring lie, radians."""
    return 2 * jnp.pi * jnp.arange(num_states, dtype=float) / num_states


def ring_and_network() -> tuple[Ring, Policy, PyTree]:
    """A ring seen as points of the unit circle, and a network with fewer parameters than places."""
    x = angles(12)
    policy = MLPPolicy(2, 1, hidden=(1,))
    theta = jax.tree.map(lambda leaf: leaf + 0.6, policy.init(jax.random.key(0)))
    return Ring(jnp.stack([jnp.cos(x), jnp.sin(x)], axis=1)), policy, theta


@dataclasses.dataclass(frozen=True)
class Linear:
    """V^v(s) = v^T s: linear in the observation.

    Attributes:
        observation_size: d.
    """

    observation_size: int

    def init(self, key: PRNGKeyArray) -> Float[Array, "feat"]:
        """Zero weights v."""
        return jnp.zeros(self.observation_size)

    def __call__(self, v: Float[Array, "feat"], observation: Observation) -> Number:
        return jnp.dot(v, observation, precision="highest")


class Quadrature(NamedTuple):
    """E[f(a)] of a = mu + sigma e as sum_k weights_k f(mu + sigma nodes_k)."""

    nodes: Float[Array, "nodes"]
    weights: Float[Array, "nodes"]


def gaussian(num_nodes: int = 64) -> Quadrature:
    """Standard normal e: Gauss-Hermite, exact for polynomials below degree 2 num_nodes."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(num_nodes)
    return Quadrature(jnp.asarray(nodes), jnp.asarray(weights / weights.sum()))


def certain() -> Quadrature:
    """No noise: the deterministic policy."""
    return Quadrature(jnp.zeros(1), jnp.ones(1))


class Exact(NamedTuple):
    """What a policy is worth in a ring.

    Attributes:
        value: V(s).
        action_values: Q(s, a) at the nodes of each state.
        visits: rho(s), the improper discounted state distribution.
        objective: J.
    """

    value: Float[Array, "points"]
    action_values: Float[Array, "points nodes"]
    visits: Float[Array, "points"]
    objective: Number


def solve(
    ring: Ring, policy: Policy, theta: PyTree, sigma: Number, quadrature: Quadrature
) -> Exact:
    """V, Q and rho of a = mu_theta(s) + sigma e by quadrature over e and two linear systems."""
    states = jnp.arange(ring.num_states)
    means = jax.vmap(lambda s: policy(theta, s))(ring.observations)
    actions = means[:, None, :] + sigma * quadrature.nodes[None, :, None]

    per_node = jax.vmap(jax.vmap(ring.chances, (None, 0)))(states, actions)
    rewards = jax.vmap(jax.vmap(lambda s, a: ring.reward(s, a, s), (None, 0)))(states, actions)
    kernel = jnp.einsum("k,skt->st", quadrature.weights, per_node, precision="highest")
    reward = jnp.dot(rewards, quadrature.weights, precision="highest")

    system = jnp.eye(ring.num_states, dtype=kernel.dtype) - ring.gamma * kernel
    value = jnp.linalg.solve(system, reward)
    start = jnp.full(ring.num_states, 1 / ring.num_states, dtype=kernel.dtype)
    following = jnp.einsum("skt,t->sk", per_node, value, precision="highest")
    return Exact(
        value=value,
        action_values=rewards + ring.gamma * following,
        visits=jnp.linalg.solve(system.T, start),
        objective=jnp.dot(start, value, precision="highest"),
    )


def action_value(
    ring: Ring, value: Float[Array, "points"], state: Int[Array, ""], action: Action
) -> Number:
    """Q(s, a) = r(s, a) + gamma E[V(s')]."""
    following = jnp.dot(ring.chances(state, action), value, precision="highest")
    return ring.reward(state, action, state) + ring.gamma * following


def deterministic_gradient(ring: Ring, policy: Policy, theta: PyTree) -> Float[Array, "feat"]:
    """The gradient of J(mu_theta), by differentiating the solution of the Bellman equation."""

    def objective(ring: Ring, theta: PyTree) -> Number:
        return solve(ring, policy, theta, jnp.zeros(()), certain()).objective

    return trees.to_vector(jax.jit(jax.grad(objective, argnums=1))(ring, theta))
