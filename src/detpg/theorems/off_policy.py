"""Eq. 15, the off-policy gradient: what the dropped term costs, on the LQR.

The behaviour is another gain. Everything is exact: V and Q are quadratic, so that a mean over
rho^beta is a sum over as many states as carry its mass and second moment.
"""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from detpg.actors import deterministic_direction
from detpg.environments import LQR
from detpg.policies import LinearPolicy
from detpg.theorems.record import (
    Check,
    Group,
    Point,
    check,
    exponent,
    fitted_power,
    points,
    relative_error,
    rounding,
)
from detpg.theorems.worlds import regulator
from detpg.types import Number

Gain = Float[Array, "act obs"]
DIRECTION = ((0.5, -0.5, 0.0), (0.0, 0.5, 0.5))  # of length 1: from the target to the behaviour
BEHAVIOUR = 0.5  # how far the behaviour is
DISTANCES = (-1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)
SMALL = tuple(0.1 * 0.5**k for k in range(8))  # distances, and discounts, for exponents
MARGIN = 0.1


class Gradients(NamedTuple):
    """Both sides of eq. 15, and what lies between them."""

    exact: Gain
    kept: Gain
    dropped: Gain


Sides = Callable[[Gain, Gain], Gradients]  # of behaviour and target, in one world


def visited(world: LQR, behaviour: Gain) -> tuple[Float[Array, "points obs"], Number]:
    """States of equal weight with the mass and second moment of rho^beta, and the weight."""
    moment = world.state_moment(behaviour)
    d = moment.shape[0]
    weight = 1 / (1 - world.gamma) / (2 * d)
    root = jnp.linalg.cholesky(moment / (2 * weight)).T
    return jnp.concatenate([root, -root]), jnp.asarray(weight)


def objective(world: LQR, behaviour: Gain, gain: Gain) -> Number:
    """J_beta(mu) = E over rho^beta of V^mu (eq. 14), in closed form."""
    P = world.cost_to_go(gain)
    constant = world.gamma / (1 - world.gamma) * world.noise**2 * jnp.trace(P)
    moment = world.state_moment(behaviour)
    return -(jnp.vdot(P, moment, precision="highest") + constant / (1 - world.gamma))


def kept(world: LQR, behaviour: Gain, gain: Gain) -> Gain:
    """Eq. 15: E over rho^beta of grad mu grad_a Q^mu, through the library's actor."""
    states, weight = visited(world, behaviour)
    policy = LinearPolicy(*gain.shape[::-1])

    def one(s: Array) -> Gain:
        return deterministic_direction(policy, gain, s, partial(world.action_value, gain, s))

    return weight * jnp.sum(jax.vmap(one)(states), axis=0)


def dropped(world: LQR, behaviour: Gain, gain: Gain) -> Gain:
    """What eq. 15 leaves out: E over rho^beta of grad_theta Q^mu(s, a) at a = mu(s)."""
    states, weight = visited(world, behaviour)

    def one(s: Array) -> Gain:
        return jax.grad(world.action_value)(gain, s, jnp.dot(gain, s, precision="highest"))

    return weight * jnp.sum(jax.vmap(one)(states), axis=0)


def gradients(world: LQR, behaviour: Gain, gain: Gain) -> Gradients:
    """All three at one point."""
    exact = jax.grad(partial(objective, world, behaviour))(gain)
    return Gradients(exact, kept(world, behaviour, gain), dropped(world, behaviour, gain))


def best_gain(world: LQR, gain: Gain) -> Gain:
    """Of all gains, by policy iteration: quadratic convergence."""

    def improve(_: Array, gain: Gain) -> Gain:
        P = world.gamma * world.cost_to_go(gain)
        curvature = world.R + world.B.T @ P @ world.B
        return -jnp.linalg.solve(curvature, world.B.T @ P @ world.A)

    return jax.lax.fori_loop(0, 20, improve, gain)


def run() -> Group:
    """The identity, the size of the dropped term, and what it does to optima."""
    world, gain = regulator()
    away = jnp.asarray(DIRECTION)
    sides = jax.jit(partial(gradients, world))
    size, rows = _size(world, gain, away, sides)
    aliased, aliased_rows = _aliased(world, gain, away)
    return Group(
        "Eq. 15: the off-policy deterministic policy gradient",
        (
            *size,
            _on_policy(world, gain, away, sides),
            _no_discount(world, gain, away),
            _optimum(world, gain, away, sides),
            aliased,
        ),
        (*rows, *aliased_rows),
    )


def _cosine(a: Array, b: Array) -> float:
    return float(jnp.vdot(a, b) / jnp.linalg.norm(a) / jnp.linalg.norm(b))


def _size(
    world: LQR, gain: Gain, away: Array, sides: Sides
) -> tuple[tuple[Check, ...], tuple[Point, ...]]:
    """How much eq. 15 leaves out, for behaviours on both sides of the target."""
    found = [sides(gain + distance * away, gain) for distance in DISTANCES]
    identity = [relative_error(g.kept + g.dropped, g.exact) for g in found]
    lost = [relative_error(g.kept, g.exact) for g in found]
    cosine = [_cosine(g.kept, g.exact) for g in found]
    condition = np.linalg.cond(world.state_moment(gain))
    checks = (
        check(
            "off-policy/identity",
            "eq. 15 and the term that it drops, E over rho^beta of grad_theta Q^mu, make up the "
            "gradient of J_beta: relative error 0 to rounding, behaviours at 9 distances",
            identity,
            0.0,
            rounding(condition),
        ),
        check(
            "off-policy/dropped-term",
            "the dropped term is no small one: relative error of eq. 15 against the gradient of "
            "J_beta at least 0.5 at each of the distances",
            lost,
            0.5,
            0.0,
            "at least",
        ),
        check(
            "off-policy/ascent",
            "its direction suffers less: cosine with the gradient of J_beta at least 0.9",
            cosine,
            0.9,
            0.0,
            "at least",
        ),
    )
    x = "distance of the behaviour from the target (gain)"
    rows = (
        *points(x, "eq. 15 against the gradient of J_beta", "relative error", DISTANCES, lost),
        *points(x, "eq. 15 against the gradient of J_beta", "cosine", DISTANCES, cosine),
    )
    return checks, rows


def _on_policy(world: LQR, gain: Gain, away: Array, sides: Sides) -> Check:
    """With beta = mu eq. 15 is eq. 9; it leaves it in proportion to the distance."""
    exact = jax.jit(jax.grad(world.objective))(gain)
    errors = [relative_error(sides(gain + distance * away, gain).kept, exact) for distance in SMALL]
    power = fitted_power(SMALL, errors, next_term=1)
    return exponent(
        "off-policy/distance",
        "eq. 15 leaves grad J(mu), which it is for beta = mu, in proportion to the behaviour's "
        "distance",
        power,
        1.0,
    )


def _no_discount(world: LQR, gain: Gain, away: Array) -> Check:
    """With gamma = 0 Q does not depend on theta: nothing is dropped."""
    blind = dataclasses.replace(world, gamma=0.0)
    found = jax.jit(partial(gradients, blind))(gain + BEHAVIOUR * away, gain)
    return check(
        "off-policy/no-discount",
        "with discount 0 nothing is dropped: relative error of eq. 15 is 0 to rounding",
        relative_error(found.kept, found.exact),
        0.0,
        rounding(np.linalg.cond(blind.state_moment(gain))),
    )


def _optimum(world: LQR, gain: Gain, away: Array, sides: Sides) -> Check:
    """Where grad_a Q = 0 in every state, nothing is left to drop."""
    best = jax.jit(partial(best_gain, world))(gain)
    found = sides(gain + BEHAVIOUR * away, best)
    scale = jnp.linalg.norm(sides(gain + BEHAVIOUR * away, gain).exact)
    return check(
        "off-policy/optimum",
        "at the best gain of all eq. 15 and the gradient of J_beta are both 0 (over the latter's "
        "norm at the starting gain)",
        [jnp.linalg.norm(g) / scale for g in (found.kept, found.exact)],
        0.0,
        rounding(np.linalg.cond(world.state_moment(best))),
    )


def _aliased(world: LQR, gain: Gain, away: Array) -> tuple[Check, tuple[Point, ...]]:
    """A policy that sees the first state component alone: eq. 15 stops elsewhere."""
    forfeits = jax.jit(jax.vmap(partial(forfeited, world)))
    behaviours = gain[None] + jnp.asarray(DISTANCES)[:, None, None] * away[None]
    lost = np.asarray(forfeits(behaviours))
    made = check(
        "off-policy/aliased",
        "if the policy sees one of three state components, ascent along eq. 15 stops at another "
        f"gain: of what J_beta can gain it forfeits at least {MARGIN:g} (behaviour at distance 0)",
        lost[DISTANCES.index(0.0)],
        MARGIN,
        0.0,
        "at least",
    )
    x = "distance of the behaviour from the target (gain)"
    name = x, "aliased policy: share of J_beta's possible gain that eq. 15 forfeits"
    return made, points(*name, "forfeited", DISTANCES, lost)


def forfeited(world: LQR, behaviour: Gain) -> Number:
    """1 - (J_beta where eq. 15 is zero - J_beta of no control) / (the same where its gradient is).

    The policies are the gains whose first column alone is not zero.
    """

    def gain(k: Array) -> Gain:
        return jnp.zeros_like(behaviour).at[:, 0].set(k)

    def worth(k: Array) -> Number:
        return objective(world, behaviour, gain(k))

    def eq_15(k: Array) -> Array:
        return kept(world, behaviour, gain(k))[:, 0]

    none = jnp.zeros_like(behaviour[:, 0])
    best, stop = (worth(_zero(f, none)) for f in (jax.grad(worth), eq_15))
    return (best - stop) / (best - worth(none))


def _zero(f: Callable[[Array], Array], start: Array) -> Array:
    """A zero, by Newton's method."""

    def step(_: Array, x: Array) -> Array:
        return x - jnp.linalg.solve(jax.jacfwd(f)(x), f(x))

    return jax.lax.fori_loop(0, 20, step, start)
