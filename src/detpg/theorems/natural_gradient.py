"""The natural gradient (end of Section 4.3): M^-1 grad J is w itself."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from detpg import trees
from detpg.features import score
from detpg.policies import GaussianParameters, IsotropicGaussian
from detpg.theorems.record import (
    Check,
    Group,
    check,
    exponent,
    fitted_power,
    guide,
    points,
    relative_error,
    rounding,
)
from detpg.theorems.theorem_3 import jacobians, least_squares, problem
from detpg.theorems.worlds import (
    Ring,
    deterministic_gradient,
    gaussian,
    regulator,
    solve,
)
from detpg.types import Number, Observation, Policy

WIDTHS = tuple(0.1 * 0.5**k for k in range(8))
AXES = (
    "sigma, width of the policy (action units)",
    "relative difference of sigma^2 times the Fisher metric and M",
)


def run() -> Group:
    """M^-1 grad J = w for a network and for the LQR; M as the limit of the Fisher metric."""
    policy, known = problem()
    features = np.asarray(jax.jit(partial(jacobians, policy))(known.theta, known.ring))
    metric = features.T @ (np.asarray(known.on_policy)[:, None] * features)
    w, condition = least_squares(features, known.slopes, known.on_policy)
    steepest = np.linalg.solve(metric, deterministic_gradient(known.ring, policy, known.theta))
    network = check(
        "natural-gradient/network",
        "for a tanh network M^-1 grad J is the compatible solution w: relative difference 0 to "
        f"rounding (condition number of M {condition:.1g})",
        relative_error(steepest, w),
        0.0,
        rounding(condition),
    )
    at_width = jax.jit(jax.vmap(partial(fisher, policy), (None, None, 0)))
    metrics = at_width(known.ring, known.theta, jnp.asarray(WIDTHS))
    errors = [relative_error(found, metric) for found in metrics]
    order = fitted_power(WIDTHS, errors, next_term=2)
    limit = exponent(
        "natural-gradient/fisher-limit",
        "sigma^2 times the Fisher metric of N(mu, sigma^2) tends to M like sigma^2",
        order,
        2.0,
    )
    rows = (
        *points(*AXES, "measured", WIDTHS, errors),
        *guide(*AXES, "sigma^2", WIDTHS, errors[-1], 2.0),
    )
    return Group("The natural gradient", (network, _regulator(), limit), rows)


def _regulator() -> Check:
    """Linear policy: M is the second moment of rho, once for each action component."""
    world, gain = regulator()

    @jax.jit
    def both(gain: Array) -> tuple[Array, Array, Array]:
        moment = world.state_moment(gain)
        natural = jnp.linalg.solve(moment, jax.grad(world.objective)(gain).T).T

        def slope(s: Array) -> Array:
            return jax.grad(world.action_value, argnums=2)(gain, s, jnp.dot(gain, s))

        # grad mu^T w = w s is grad_a Q in every state: the compatible solution.
        w = jax.vmap(slope)(jnp.eye(moment.shape[0], dtype=gain.dtype)).T
        return natural, w, moment

    natural, w, moment = both(gain)
    return check(
        "natural-gradient/lqr",
        "for the linear policy of an LQR M^-1 grad J is the compatible solution w, entry by entry",
        natural,
        w,
        rounding(np.linalg.cond(moment)) * np.abs(w).max(),
    )


def fisher(policy: Policy, ring: Ring, theta: PyTree, sigma: Number) -> Float[Array, "feat feat"]:
    """sigma^2 E of (grad log pi)(grad log pi)^T over rho^pi and pi = N(mu, sigma^2)."""
    quadrature = gaussian(8)
    exact = solve(ring, policy, theta, sigma, quadrature)
    noisy = IsotropicGaussian(policy)
    parameters = GaussianParameters(theta=theta, y=2 * jnp.log(sigma))

    def at(s: Observation, node: Number) -> Array:
        action = policy(theta, s) + sigma * node[None]
        return trees.to_vector(score(noisy, parameters, s, action).theta)

    scores = jax.vmap(jax.vmap(at, (None, 0)), (0, None))(ring.observations, quadrature.nodes)
    weights = exact.visits[:, None] * quadrature.weights[None, :]
    return sigma**2 * jnp.einsum("sk,skm,skn->mn", weights, scores, scores, precision="highest")
