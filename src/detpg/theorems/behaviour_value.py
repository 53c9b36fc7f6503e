"""What COPDAC-Q's critic learns when its actor stands still.

With zero-mean noise about mu the advantage has mean zero in every state, and it is zero at the
next action mu(s'). So the TD error's mean is that of TD(0) for the behaviour: v tends to V^beta,
not to V^mu. And w regresses r + gamma V^beta(s') on the noise, which gives E_beta of grad_a Q^beta
(Stein's identity).

Episodes are cut after one step, which does not stop bootstrapping: transitions are independent, and
for a critic that can represent V^beta the mean of v and w is then exactly the fixed point, with any
constant step size. Along trajectories it is off by a bias in proportion to the step size.
"""

import dataclasses
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Key, PRNGKeyArray, PyTree

from detpg import trees
from detpg.algorithms import COPDACQ
from detpg.environments import LQR
from detpg.policies import LinearPolicy
from detpg.theorems.record import SIGMAS, Check, Group, Point, check, exponent, fitted_power, points
from detpg.theorems.worlds import (
    Linear,
    Ring,
    action_value,
    gaussian,
    solve,
)
from detpg.training import TrainState, begin, train
from detpg.types import Action, Environment, EnvironmentSpec, Number, Observation

RING_THETA = (0.3, -0.2, 0.5, 0.0, -0.4)  # mu(s) in each of five places
RING_WIDTH = 0.7
LQR_GAIN = ((0.2, -0.5),)
LQR_WIDTH = 0.5
WIDTHS = tuple(0.1 * 0.5**k for k in range(8))
CHUNK = 1_000  # steps between which weights are averaged and stored
FAR = 20.0  # standard errors


class OneStep(eqx.Module):
    """A world whose episodes are cut after one step; the transition itself is not changed."""

    world: Environment

    @property
    def spec(self) -> EnvironmentSpec:
        return dataclasses.replace(self.world.spec, time_limit=1)

    def initial(self, key: PRNGKeyArray) -> PyTree:
        return self.world.initial(key)

    def transition(self, key: PRNGKeyArray, state: PyTree, action: Action) -> PyTree:
        return self.world.transition(key, state, action)

    def reward(self, state: PyTree, action: Action, next_state: PyTree) -> Number:
        return self.world.reward(state, action, next_state)

    def terminated(self, state: PyTree) -> Bool[Array, ""]:
        return self.world.terminated(state)

    def observe(self, state: PyTree) -> Observation:
        return self.world.observe(state)


class Learnt(NamedTuple):
    """Weights of the critic, averaged over the last part of each run: mean and standard error."""

    v: np.ndarray
    v_error: np.ndarray
    w: np.ndarray
    w_error: np.ndarray


def learn(
    learner: COPDACQ, world: Environment, theta: Array, steps: Sequence[float], num_runs: int
) -> Learnt:
    """COPDAC-Q with its actor at rest: ten chunks at each step size, the last ten averaged.

    Args:
        learner: With alpha_theta = 0.
        world: Its episodes are cut after one step.
        theta: Of the actor.
        steps: Step sizes of the critic, decreasing; each goes on where the one before ended.
        num_runs: Independent runs.
    """
    keys = jax.random.split(jax.random.key(7), num_runs)
    world = OneStep(world)

    @jax.jit
    def chunk(learner: COPDACQ, keys: Key[Array, "runs"], states: TrainState):
        def one(key: PRNGKeyArray, state: TrainState) -> tuple[TrainState, PyTree]:
            state, log = train(
                learner, world, key, CHUNK, start=state, probe=lambda seen: (seen.v, seen.w)
            )
            return state, trees.mean(log.probe)

        return jax.vmap(one)(keys, states)

    @jax.jit
    def start(keys: Key[Array, "runs"]) -> TrainState:
        states = jax.vmap(partial(begin, learner, world))(keys)
        resting = jnp.broadcast_to(theta, (num_runs, *theta.shape))
        return eqx.tree_at(lambda state: state.learner.theta, states, resting)

    states, averages = start(keys), []
    for size in steps:
        alpha = jnp.asarray(size)
        learner = eqx.tree_at(lambda made: (made.alpha_v, made.alpha_w), learner, (alpha, alpha))
        averages = []
        for _ in range(10):
            states, average = chunk(learner, keys, states)
            averages.append(average)
    v, w = (np.mean(parts, axis=0).reshape(num_runs, -1) for parts in zip(*averages))
    root = np.sqrt(num_runs)
    return Learnt(
        v.mean(axis=0), v.std(axis=0, ddof=1) / root, w.mean(axis=0), w.std(axis=0, ddof=1) / root
    )


def run(num_runs: int = 128) -> Group:
    """On a ring of five places and on the LQR, against linear systems and quadrature.

    Args:
        num_runs: Independent runs of the learner.
    """
    ring_checks, ring_points = _ring(num_runs)
    return Group(
        "COPDAC-Q's critic: the value of the behaviour",
        (*ring_checks, *_regulator(num_runs), *_limit()),
        ring_points,
    )


def ring() -> tuple[Ring, Array]:
    """Five places told apart, and an action for each."""
    return Ring(jnp.eye(len(RING_THETA))), jnp.asarray([RING_THETA])


def mean_slopes(
    world: Ring, theta: Float[Array, "act obs"], sigma: Number
) -> tuple[Float[Array, "points"], Float[Array, "points"]]:
    """V^beta and E_beta of grad_a Q^beta(s, a) of beta = N(mu, sigma^2), by quadrature.

    With sigma = 0 they are V^mu and grad_a Q^mu at mu(s).
    """
    quadrature = gaussian()
    value = solve(world, LinearPolicy(len(RING_THETA), 1), theta, sigma, quadrature).value

    def one(state: Array, mean: Number) -> Number:
        slope = jax.vmap(jax.grad(partial(action_value, world, value, state)))
        slopes = slope((mean + sigma * quadrature.nodes)[:, None])[:, 0]
        return jnp.dot(quadrature.weights, slopes, precision="highest")

    return value, jax.vmap(one)(jnp.arange(world.num_states), theta[0])


def _ring(num_runs: int) -> tuple[tuple[Check, ...], tuple[Point, ...]]:
    """Tabular critic: five values and five slopes."""
    world, theta = ring()
    tabular = Linear(len(RING_THETA))
    learner = COPDACQ.create(world.spec, state_value=tabular, alpha_theta=0.0, sigma=RING_WIDTH)
    found = learn(learner, world, theta, (0.2, 0.05), num_runs)
    exact = jax.jit(partial(mean_slopes, world, theta))
    value, slope = exact(jnp.asarray(RING_WIDTH))
    target_value, target_slope = exact(jnp.zeros(()))
    checks = (
        check(
            "behaviour/ring/value",
            f"v is V^beta in each of five states (beta = N(mu, {RING_WIDTH:g}^2), {num_runs} runs)",
            found.v,
            value,
            SIGMAS * found.v_error,
        ),
        check(
            "behaviour/ring/slope",
            "w is E_beta of grad_a Q^beta in each state",
            found.w,
            slope,
            SIGMAS * found.w_error,
        ),
        _far(
            "behaviour/ring/not-the-target", "v is not V^mu", found.v, target_value, found.v_error
        ),
        _far(
            "behaviour/ring/not-its-slope",
            "w is not grad_a Q^mu at mu(s)",
            found.w,
            target_slope,
            found.w_error,
        ),
    )
    places = range(1, 6)
    x, values, slopes = "state", "state value", "slope (value per action unit)"
    rows = (
        *points(x, values, "v, learnt", places, found.v, found.v_error),
        *points(x, values, "V of the behaviour", places, value),
        *points(x, values, "V of the target", places, target_value),
        *points(x, slopes, "w, learnt", places, found.w, found.w_error),
        *points(x, slopes, "mean slope, behaviour's Q", places, slope),
        *points(x, slopes, "slope at mu, target's Q", places, target_slope),
    )
    return checks, rows


def _far(id: str, words: str, found: np.ndarray, other: Array, error: np.ndarray) -> Check:
    """Where two things differ most, by how many standard errors."""
    return check(
        id,
        f"{words}: largest difference at least {FAR:g} standard errors",
        np.max(np.abs(found - np.asarray(other)) / error),
        FAR,
        0.0,
        "at least",
    )


def _regulator(num_runs: int) -> tuple[Check, ...]:
    """Q is quadratic: the noise shifts V by a constant and leaves the slope as it is."""
    world, gain = LQR(noise=0.3, gamma=0.8), jnp.asarray(LQR_GAIN)
    learner = COPDACQ.create(world.spec, alpha_theta=0.0, sigma=LQR_WIDTH)
    found = learn(learner, world, gain, (0.04, 0.02), num_runs)

    @jax.jit
    def exact(gain: Array) -> tuple[Array, Array, Array]:
        """V^beta and V^mu over the products of (1, s_1, s_2); grad_a Q at mu."""
        P = world.cost_to_go(gain)
        curvature = world.R + world.gamma * world.B.T @ P @ world.B
        target = world.value(gain, jnp.zeros_like(P[0]))
        behaviour = target - LQR_WIDTH**2 * jnp.trace(curvature) / (1 - world.gamma)
        quadratic = jnp.stack([-P[0, 0], -2 * P[0, 1], -P[1, 1]])
        zeros = jnp.zeros(2, dtype=P.dtype)
        values = [jnp.concatenate([c[None], zeros, quadratic]) for c in (behaviour, target)]

        def slope(s: Array) -> Array:
            return jax.grad(world.action_value, argnums=2)(gain, s, jnp.dot(gain, s))[0]

        return values[0], values[1], jax.vmap(slope)(jnp.eye(2, dtype=P.dtype))

    behaviour, target, slope = exact(gain)
    return (
        check(
            "behaviour/lqr/value",
            "on the LQR v is V^beta, weight by weight over the products of (1, s_1, s_2)",
            found.v,
            behaviour,
            SIGMAS * found.v_error,
        ),
        check(
            "behaviour/lqr/slope",
            "and w the slope grad_a Q, which the noise does not change",
            found.w,
            slope,
            SIGMAS * found.w_error,
        ),
        _far("behaviour/lqr/not-the-target", "v is not V^mu", found.v, target, found.v_error),
    )


def _limit() -> tuple[Check, ...]:
    """The bias against what a deterministic policy gradient needs, as the noise goes to zero."""
    world, theta = ring()
    widths = jnp.asarray([*WIDTHS, 0.0])
    exact = jax.jit(jax.vmap(partial(mean_slopes, world, theta)))(widths)
    values, slopes = map(np.asarray, exact)
    checks = []
    for name, words, found in (
        ("value", "V^beta to V^mu", values),
        ("slope", "E_beta of grad_a Q^beta to grad_a Q^mu at mu(s)", slopes),
    ):
        errors = np.linalg.norm(found[:-1] - found[-1], axis=1)
        power = fitted_power(WIDTHS, errors, next_term=2)
        checks.append(
            exponent(
                f"behaviour/limit/{name}",
                f"the bias vanishes with the noise, {words} like sigma^2",
                power,
                2.0,
            )
        )
    return tuple(checks)
