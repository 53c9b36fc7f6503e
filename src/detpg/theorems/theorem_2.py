"""Theorem 2 (eq. 10): the stochastic gradient tends to the deterministic one, and how fast.

The gradient of J(pi_{mu,sigma}) is a smooth function of the moments of the noise. With a symmetric
density the odd moments vanish and the error begins with sigma^2 times the variance of the density;
with a skewed one it begins with sigma times its mean. On an LQR, Q is quadratic, and all symmetric
densities of one variance give the same gradient; the ring is not quadratic, and everything in it is
a finite sum.
"""

import dataclasses
from collections.abc import Callable
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray, PyTree

from detpg import trees
from detpg.actors import likelihood_ratio_direction
from detpg.features import score
from detpg.theorems.record import Group, exponent, fitted_power, guide, points, relative_error
from detpg.theorems.worlds import (
    Exact,
    Quadrature,
    Ring,
    deterministic_gradient,
    gaussian,
    ring_and_network,
    solve,
)
from detpg.types import Action, Number, Observation, Policy

AXES = (
    "sigma, width of the policy (action units)",
    "relative difference of stochastic and deterministic gradient",
)
WIDTHS = tuple(0.1 * 0.5**k for k in range(8))


@dataclasses.dataclass(frozen=True)
class Density:
    """xi(e), the shape of nu_sigma(mu, a) = xi((a - mu) / sigma) / sigma (conditions B.1).

    Attributes:
        words: What it is.
        log: e -> log xi(e), up to a constant.
        order: Power of sigma with which the gradient's error begins.
        compact: Whether it is zero outside of [-1, 1].
    """

    words: str
    log: Callable[[Number], Number]
    order: int
    compact: bool = True

    def quadrature(self, num_nodes: int) -> Quadrature:
        """Gauss-Legendre on [-1, 1], or Gauss-Hermite."""
        if not self.compact:
            return gaussian(num_nodes)
        nodes, weights = map(jnp.asarray, np.polynomial.legendre.leggauss(num_nodes))
        weights = weights * jnp.exp(jax.vmap(self.log)(nodes))
        return Quadrature(nodes, weights / jnp.sum(weights))


def _log_gaussian(e: Number) -> Number:
    return -0.5 * e**2


def _log_bump(e: Number) -> Number:
    return -1 / (1 - e**2)


def _log_polynomial(e: Number) -> Number:
    return 4 * jnp.log1p(-(e**2))


def _log_skewed(e: Number) -> Number:
    return _log_polynomial(e) + jnp.log1p(e)


DENSITIES = {
    "gaussian": Density("a Gaussian", _log_gaussian, 2, compact=False),
    "bump": Density("the bump exp(-1 / (1 - e^2))", _log_bump, 2),
    "polynomial": Density("the bump (1 - e^2)^4", _log_polynomial, 2),
    "skewed": Density("the skewed bump (1 - e^2)^4 (1 + e)", _log_skewed, 1),
}


class Noisy(eqx.Module):
    """pi_{mu_theta, sigma}: the policy mu_theta with noise of a given shape and width.

    Attributes:
        mean: mu_theta (static).
        density: xi (static).
        sigma: Width, action units.
    """

    mean: Policy = eqx.field(static=True)
    density: Density = eqx.field(static=True)
    sigma: Number

    def init(self, key: PRNGKeyArray) -> PyTree:
        return self.mean.init(key)

    def __call__(self, theta: PyTree, observation: Observation) -> Action:
        return self.mean(theta, observation)

    def sample(self, key: PRNGKeyArray, theta: PyTree, observation: Observation) -> Action:
        raise NotImplementedError("Its expectations are taken by quadrature.")

    def log_prob(self, theta: PyTree, observation: Observation, action: Action) -> Number:
        error = (action - self.mean(theta, observation)) / self.sigma
        return self.density.log(error[0]) - jnp.log(self.sigma)


def stochastic_gradient(
    ring: Ring, theta: PyTree, sigma: Number, policy: Policy, density: Density, num_nodes: int = 128
) -> Float[Array, "feat"]:
    """Eq. 2: E of grad log pi Q^pi over rho^pi and pi."""
    quadrature = density.quadrature(num_nodes)
    exact: Exact = solve(ring, policy, theta, sigma, quadrature)
    noisy = Noisy(policy, density, sigma)

    def at(s: Observation, node: Number, value: Number) -> Array:
        action = policy(theta, s) + sigma * node[None]
        return trees.to_vector(likelihood_ratio_direction(score(noisy, theta, s, action), value))

    per_node = jax.vmap(jax.vmap(at, (None, 0, 0)), (0, None, 0))
    directions = per_node(ring.observations, quadrature.nodes, exact.action_values)
    weights = exact.visits[:, None] * quadrature.weights[None, :]
    return jnp.einsum("sk,skn->n", weights, directions, precision="highest")


def run() -> Group:
    """The order in sigma of each density."""
    ring, policy, theta = ring_and_network()
    exact = deterministic_gradient(ring, policy, theta)
    checks, rows, errors_of = [], [], {}
    for name, density in DENSITIES.items():
        at_width = partial(stochastic_gradient, policy=policy, density=density)
        gradients = jax.jit(jax.vmap(at_width, (None, None, 0)))(ring, theta, jnp.asarray(WIDTHS))
        errors_of[name] = errors = [relative_error(gradient, exact) for gradient in gradients]
        # Each term of the expansion in sigma is as far from the one before as the first from 1.
        order = fitted_power(WIDTHS, errors, next_term=density.order)
        checks.append(
            exponent(
                f"theorem-2/{name}",
                f"with {density.words} the stochastic gradient tends to the deterministic one like "
                f"sigma^{density.order}",
                order,
                float(density.order),
            )
        )
        rows += points(*AXES, density.words, WIDTHS, errors)
    for power, last in ((2.0, errors_of["gaussian"][-1]), (1.0, errors_of["skewed"][-1])):
        rows += guide(*AXES, f"sigma^{power:g}", WIDTHS, last, power)
    return Group(
        "Theorem 2: the limit of the stochastic policy gradient", tuple(checks), tuple(rows)
    )
