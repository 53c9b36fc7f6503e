"""Theorem 3: the two conditions of compatibility, kept and broken.

The network has fewer parameters than the ring has places, so that no compatible critic has the
exact slope in every state: the gradient is right although the critic is not.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree
from numpy.typing import ArrayLike

from detpg import trees
from detpg.actors import compatible_direction, deterministic_direction
from detpg.theorems.record import (
    Check,
    Group,
    Point,
    check,
    exponent,
    fitted_power,
    guide,
    points,
    relative_error,
    rounding,
)
from detpg.theorems.worlds import (
    Ring,
    action_value,
    certain,
    deterministic_gradient,
    gaussian,
    ring_and_network,
    solve,
)
from detpg.types import Number, Policy

AMOUNTS = tuple(0.5**k for k in range(15))  # by which a condition is broken
NUM_FITTED = 8  # of the least amounts: the exponent is that of the limit
MARGIN = 0.1
BROKEN = "e, amount by which a condition is broken", "relative error of the gradient"
BEHAVIOUR_WIDTH = 0.7


class Problem(NamedTuple):
    """A ring, a policy, and what its critic is to learn.

    Attributes:
        ring: The world.
        theta: Of mu.
        value: V^mu.
        on_policy: rho^mu.
        off_policy: rho^beta of a Gaussian behaviour.
        slopes: grad_a Q^mu(s, a) at a = mu(s).
    """

    ring: Ring
    theta: PyTree
    value: Float[Array, "points"]
    on_policy: Float[Array, "points"]
    off_policy: Float[Array, "points"]
    slopes: Float[Array, "points"]


def problem() -> tuple[Policy, Problem]:
    """The network on the ring, everything about it computed."""
    ring, policy, theta = ring_and_network()

    @jax.jit
    def solved(ring: Ring, theta: PyTree) -> Problem:
        exact = solve(ring, policy, theta, jnp.zeros(()), certain())
        behaviour = solve(ring, policy, theta, jnp.asarray(BEHAVIOUR_WIDTH), gaussian())

        def slope(state: Array, s: Array) -> Number:
            q = partial(action_value, ring, exact.value, state)
            return jax.grad(q)(policy(theta, s))[0]

        slopes = jax.vmap(slope)(jnp.arange(ring.num_states), ring.observations)
        return Problem(ring, theta, exact.value, exact.visits, behaviour.visits, slopes)

    return policy, solved(ring, theta)


def jacobians(policy: Policy, theta: PyTree, ring: Ring) -> Float[Array, "points feat"]:
    """The gradient of mu(s), a row for each state: the matrix that the library never forms."""

    def one(s: Array) -> Array:
        return trees.to_vector(jax.jacobian(lambda p: policy(p, s)[0])(theta))

    return jax.vmap(one)(ring.observations)


def least_squares(
    features: np.ndarray, targets: ArrayLike, weights: ArrayLike
) -> tuple[np.ndarray, float]:
    """The w that minimises sum weights (features w - targets)^2, and the condition number."""
    root = np.sqrt(weights)
    w = np.linalg.lstsq(features * root[:, None], np.asarray(targets) * root)[0]
    return w, float(np.linalg.cond(features * root[:, None])) ** 2


def compatible_gradient(
    policy: Policy, known: Problem, weights: Float[Array, "points"], w: Float[Array, "feat"]
) -> Float[Array, "feat"]:
    """E of grad mu (grad mu^T w) over weighted states (eq. 20)."""

    def one(s: Array) -> Array:
        tree = trees.like(known.theta, w)
        return trees.to_vector(compatible_direction(policy, known.theta, s, tree))

    return jnp.dot(weights, jax.vmap(one)(known.ring.observations), precision="highest")


def critic_gradient(
    policy: Policy, known: Problem, weights: Float[Array, "points"], slopes: Float[Array, "points"]
) -> Float[Array, "feat"]:
    """E of grad mu grad_a Q over weighted states, for any slopes grad_a Q in them (eq. 15)."""

    def one(s: Array, slope: Number) -> Array:
        q = partial(jnp.vdot, jnp.reshape(slope, (1,)))
        return trees.to_vector(deterministic_direction(policy, known.theta, s, q))

    return jnp.dot(weights, jax.vmap(one)(known.ring.observations, slopes), precision="highest")


def run() -> Group:
    """Both conditions kept, then each broken by a growing amount."""
    policy, known = problem()
    features = np.asarray(jax.jit(partial(jacobians, policy))(known.theta, known.ring))
    random = np.random.default_rng(0).standard_normal((features.shape[0] + 1, features.shape[1]))
    kept, rows = _kept(policy, known, features)
    w_broken, w_rows = _without_condition_2(policy, known, features, random[0])
    phi_broken, phi_rows = _without_condition_1(policy, known, features, random[1:])
    return Group(
        "Theorem 3: compatible function approximation",
        (*kept, *phi_broken, *w_broken),
        (*rows, *phi_rows, *w_rows, *guide(*BROKEN, "e", AMOUNTS, phi_rows[-1].y, 1.0)),
    )


def _kept(
    policy: Policy, known: Problem, features: np.ndarray
) -> tuple[tuple[Check, ...], tuple[Point, ...]]:
    """The compatible critic of least error, on and off policy."""
    gradient = jax.jit(partial(compatible_gradient, policy))
    w, condition = least_squares(features, known.slopes, known.on_policy)
    on_policy = relative_error(
        gradient(known, known.on_policy, w), deterministic_gradient(known.ring, policy, known.theta)
    )
    w_off, condition_off = least_squares(features, known.slopes, known.off_policy)
    truth = jax.jit(partial(critic_gradient, policy))(known, known.off_policy, known.slopes)
    off_policy = relative_error(gradient(known, known.off_policy, w_off), truth)
    misfit = relative_error(
        np.sqrt(known.on_policy) * (features @ w), np.sqrt(known.on_policy) * known.slopes
    )
    checks = (
        check(
            "theorem-3/compatible",
            "with both conditions E over rho^mu of grad mu grad_a Q^w is grad J: relative error 0 "
            "to rounding",
            on_policy,
            0.0,
            rounding(condition),
        ),
        check(
            "theorem-3/off-policy",
            "the same over rho^beta is eq. 15 with the true Q^mu: relative error 0 to rounding",
            off_policy,
            0.0,
            rounding(condition_off),
        ),
        check(
            "theorem-3/critic-is-not-exact",
            "and yet that critic's own slope is wrong: relative root-mean-square error of "
            f"grad_a Q^w at least {MARGIN:g}",
            misfit,
            MARGIN,
            0.0,
            "at least",
        ),
    )
    states = range(known.ring.num_states)
    name = "place on the ring", "slope of Q at mu(s) (value per action unit)"
    lines = points(*name, "true slope", states, known.slopes)
    return checks, (*lines, *points(*name, "compatible critic", states, features @ w))


def _without_condition_2(
    policy: Policy, known: Problem, features: np.ndarray, direction: np.ndarray
) -> tuple[tuple[Check, ...], tuple[Point, ...]]:
    """Weights off their minimiser: the gradient is off by M times as much."""
    w, _ = least_squares(features, known.slopes, known.on_policy)
    gradient = jax.jit(jax.vmap(partial(compatible_gradient, policy), (None, None, 0)))
    unit = direction * np.linalg.norm(w) / np.linalg.norm(direction)
    moved = jnp.asarray([w + amount * unit for amount in AMOUNTS])
    gradients = gradient(known, known.on_policy, moved)
    return _broken("2", "w moved by e |w|", policy, known, gradients)


def _without_condition_1(
    policy: Policy, known: Problem, features: np.ndarray, other: np.ndarray
) -> tuple[tuple[Check, ...], tuple[Point, ...]]:
    """Features that are partly others: w minimises the error, and yet the gradient is off."""
    unit = other * np.linalg.norm(features) / np.linalg.norm(other)
    slopes = []
    for amount in AMOUNTS:
        mixed = features + amount * unit
        slopes.append(mixed @ least_squares(mixed, known.slopes, known.on_policy)[0])
    gradient = jax.jit(jax.vmap(partial(critic_gradient, policy), (None, None, 0)))
    gradients = gradient(known, known.on_policy, jnp.asarray(slopes))
    return _broken("1", "e parts of random features added", policy, known, gradients)


def _broken(
    condition: str, how: str, policy: Policy, known: Problem, gradients: Array
) -> tuple[tuple[Check, ...], tuple[Point, ...]]:
    exact = deterministic_gradient(known.ring, policy, known.theta)
    errors = [relative_error(gradient, exact) for gradient in gradients]
    power = fitted_power(AMOUNTS[-NUM_FITTED:], errors[-NUM_FITTED:], next_term=1)
    checks = (
        exponent(
            f"theorem-3/condition-{condition}-broken",
            f"without condition {condition} ({how}) the gradient is off by an error that grows "
            "like e",
            power,
            1.0,
        ),
        check(
            f"theorem-3/condition-{condition}-margin",
            f"at e = {AMOUNTS[0]:g} its relative error is at least {MARGIN:g}",
            errors[0],
            MARGIN,
            0.0,
            "at least",
        ),
    )
    return checks, points(*BROKEN, f"condition {condition} broken", AMOUNTS, errors)
