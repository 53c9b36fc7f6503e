"""Every transition of a small problem with its probability: expected updates without sampling."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from detpg.policies import LinearPolicy
from detpg.theorems.worlds import Ring, gaussian
from detpg.types import Algorithm, Transition

BAIRD_GAMMA = 0.99
BAIRD_THETA = np.full(8, 1 / 3)  # mu = 1 in every state: always along the solid line
BAIRD_V = np.array([1.0, 1, 1, 1, 1, 1, 10, 1])  # Baird's start


class Enumerated(NamedTuple):
    """Transitions under a behaviour, stacked, and how likely each is."""

    transitions: Transition
    weights: Float[Array, "points"]


def transitions(observation: Any, action: Any, reward: Any, following: Any) -> Transition:
    """Stacked transitions without a terminal state; the next action is not read by COPDAC."""

    def one(s: Array, a: Array, r: Array, next_s: Array) -> Transition:
        return Transition(
            observation=s,
            action=a[None],
            reward=r,
            next_observation=next_s,
            next_action=jnp.zeros_like(a[None]),
            terminated=jnp.asarray(False),
        )

    return jax.vmap(one)(*map(jnp.asarray, (observation, action, reward, following)))


def expected_update(learner: Algorithm, experience: Enumerated, state: PyTree) -> PyTree:
    """The mean of the learner's own update over all transitions."""
    key = jax.random.key(0)  # COPDAC's updates draw nothing

    def one(transition: Transition) -> PyTree:
        return learner.update(key, state, transition)[0]

    def mean(now: Array, after: Array) -> Array:
        if not eqx.is_inexact_array(now):
            return after[0]
        # The mean change, not the mean state: the weights add up to 1 but for rounding.
        change = after - now[None]
        return now + jnp.tensordot(experience.weights, change, 1, precision="highest")

    return jax.tree.map(mean, state, jax.vmap(one)(experience.transitions))


def ring_off_policy(theta: Array, shift: float, width: float) -> tuple[Ring, Enumerated]:
    """Six places seen through three features; the behaviour is N(mu + shift, width^2).

    States come from the behaviour's stationary distribution, actions from five quadrature nodes.
    """
    x = 2 * np.pi * np.arange(6) / 6
    ring = Ring(jnp.asarray(np.stack([np.ones(6), np.cos(x), np.sin(x)], axis=1)))
    policy, quadrature = LinearPolicy(3, 1), gaussian(5)

    def actions(s: Array) -> Array:
        return policy(theta, s)[0] + shift + width * quadrature.nodes

    taken = np.asarray(jax.vmap(actions)(ring.observations))
    states = jnp.arange(6)
    per_action = jax.vmap(jax.vmap(ring.chances, (None, 0)))
    chances = np.asarray(jax.jit(per_action)(states, jnp.asarray(taken)[..., None]))
    visited = stationary(np.einsum("k,skt->st", quadrature.weights, chances))
    reward = np.asarray(
        jax.vmap(jax.vmap(lambda s, a: ring.reward(s, a, s), (None, 0)))(
            states, jnp.asarray(taken)[..., None]
        )
    )
    s, k, t = (index.ravel() for index in np.indices(chances.shape))
    seen = np.asarray(ring.observations)
    weights = visited[s] * np.asarray(quadrature.weights)[k] * chances[s, k, t]
    made = transitions(seen[s], taken[s, k], reward[s, k], seen[t])
    return ring, Enumerated(made, jnp.asarray(weights))


def stationary(kernel: np.ndarray) -> np.ndarray:
    """The distribution that a Markov chain keeps."""
    system = np.vstack([kernel.T - np.eye(len(kernel)), np.ones(len(kernel))])
    return np.linalg.lstsq(system, np.append(np.zeros(len(kernel)), 1.0))[0]


def baird() -> Enumerated:
    """Baird's star (1995) with an action between its two lines, and COPDAC's features.

    Seven states, eight features: V = 2 v_i + v_8 in the six upper states, v_7 + 2 v_8 in the lower.
    Action 1 is the solid line, to the lower state; -1 the dashed one, to an upper state, each as
    likely. The target mu = 1 always takes the solid line; the behaviour the dashed one six times in
    seven, so that it visits all states alike. No reward: V = 0 is right, and can be represented.
    """
    features = np.zeros((7, 8))
    features[:6, :6], features[:6, 7] = 2 * np.eye(6), 1
    features[6, 6:] = 1, 2
    dashed = [(s, -1.0, t, 1 / 7 * 6 / 7 / 6) for s in range(7) for t in range(6)]
    solid = [(s, 1.0, 6, 1 / 7 / 7) for s in range(7)]
    s, action, t, weight = map(np.array, zip(*dashed, *solid, strict=True))
    made = transitions(features[s], action, np.zeros(len(s)), features[t])
    return Enumerated(made, jnp.asarray(weight))


class Moments(NamedTuple):
    """A, b and C of the critic with features psi = (phi(s, a); phi(s)), in NumPy.

    Attributes:
        A: E of psi (psi - gamma psi')^T.
        b: E of psi r.
        C: E of psi psi^T.
        D: E of psi psi'^T.
    """

    A: np.ndarray
    b: np.ndarray
    C: np.ndarray
    D: np.ndarray


def moments(experience: Enumerated, theta: np.ndarray, gamma: float) -> Moments:
    """Moments for mu = theta^T s and V = v^T s, written out without the library."""
    s = np.asarray(experience.transitions.observation)
    following = np.asarray(experience.transitions.next_observation)
    off = np.asarray(experience.transitions.action) - s @ theta[:, None]
    weights = np.asarray(experience.weights)[:, None]
    psi = np.hstack([off * s, s])
    psi_next = np.hstack([np.zeros_like(s), following])
    reward = np.asarray(experience.transitions.reward)
    return Moments(
        A=psi.T @ (weights * (psi - gamma * psi_next)),
        b=psi.T @ (weights[:, 0] * reward),
        C=psi.T @ (weights * psi),
        D=psi.T @ (weights * psi_next),
    )


def mspbe_minimiser(known: Moments) -> np.ndarray:
    """The (w, v) of least mean-squared projected Bellman error |b - A x|^2 in the metric C^-1."""
    inverse = np.linalg.pinv(known.C)
    return np.linalg.solve(known.A.T @ inverse @ known.A, known.A.T @ inverse @ known.b)


def mspbe(known: Moments, x: np.ndarray) -> np.ndarray:
    """The error itself, of one x or of each row."""
    residual = known.b - x @ known.A.T
    return np.einsum("...i,ij,...j->...", residual, np.linalg.pinv(known.C), residual)
