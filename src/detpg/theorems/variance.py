"""Section 6: the variance of the stochastic gradient, and what it owes to a missing baseline.

One sample is a state from rho^mu and an action from N(mu(s), sigma^2 I). With Q as it is the score
multiplies a number that does not shrink with the noise, and its own size is 1 / sigma: variance
~ sigma^-2, as the paper says. With V(s) as a baseline what it multiplies shrinks like sigma, and
the variance has a limit; noise in the return brings sigma^-2 back.
"""

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from detpg import trees
from detpg.actors import deterministic_direction, likelihood_ratio_direction
from detpg.environments import LQR
from detpg.features import score
from detpg.policies import GaussianParameters, IsotropicGaussian, LinearPolicy
from detpg.theorems.record import (
    SIGMAS,
    Check,
    Group,
    Point,
    Slope,
    check,
    exponent,
    fitted_power,
    guide,
    points,
    rounding,
)
from detpg.theorems.theorem_1 import discounted_states
from detpg.types import Number

WIDTHS = tuple(0.05 / 3**k for k in range(5))
DIMENSIONS = (1, 3, 9, 27)
SWEPT = 3  # action dimensions of the sweep over widths
NARROW = WIDTHS[-1:]  # width of the sweep over dimensions
RETURN_NOISE = 1.0  # standard deviation of a sampled return about Q, reward units
READINGS = {"Q": -2.0, "Q - V": 0.0, "return - V": -2.0}  # what the score multiplies: exponent
NUM_BLOCKS = 40


class Squares(NamedTuple):
    """Mean squared norms of single-sample estimates of grad J, block by block of states."""

    deterministic: Float[Array, "blocks"]
    stochastic: Float[Array, "widths readings blocks"]


def shared_shaft(num_actions: int) -> tuple[LQR, Float[Array, "act obs"]]:
    """The default LQR, driven by m motors that push together with the force of one.

    In the coordinates of the motors only their common direction matters: states, gradient and the
    deterministic estimate of it are those of m = 1, rotated.
    """
    together = jnp.full(num_actions, num_actions**-0.5)
    world = LQR(noise=0.3, gamma=0.8, B=jnp.outer(jnp.asarray([0.0, 0.5]), together))
    return world, jnp.outer(together, jnp.asarray([0.2, -0.5]))


def squared_norms(
    key: PRNGKeyArray,
    world: LQR,
    gain: Float[Array, "act obs"],
    states: Float[Array, "points obs"],
    sigma: Number,
) -> tuple[Float[Array, "points"], Float[Array, "readings points"]]:
    """|g|^2 of the deterministic estimate and of each reading of the stochastic one."""
    policy = LinearPolicy(*gain.shape[::-1])
    noisy = IsotropicGaussian(policy)
    parameters = GaussianParameters(theta=gain, y=2 * jnp.log(sigma))
    mass = 1 / (1 - world.gamma)

    def one(key: PRNGKeyArray, s: Array) -> tuple[Number, Array]:
        action_key, return_key = jax.random.split(key)
        q = partial(world.action_value, gain, s)
        deterministic = deterministic_direction(policy, gain, s, q)
        action = noisy.sample(action_key, parameters, s)
        eligibility = score(noisy, parameters, s, action).theta
        advantage = q(action) - world.value(gain, s)
        sampled = advantage + RETURN_NOISE * jax.random.normal(return_key, dtype=gain.dtype)
        values = (q(action), advantage, sampled)  # in the order of READINGS
        directions = [likelihood_ratio_direction(eligibility, value) for value in values]
        squares = jnp.stack([trees.dot(g, g) for g in directions])
        return mass**2 * trees.dot(deterministic, deterministic), mass**2 * squares

    deterministic, stochastic = jax.vmap(one)(jax.random.split(key, len(states)), states)
    return deterministic, stochastic.T


def measure(
    num_actions: int, states: Float[Array, "points obs"], widths: Sequence[float]
) -> Squares:
    """One problem at each width: the same states and the same standard normal noise."""
    world, gain = shared_shaft(num_actions)

    @jax.jit
    def blocks(states: Array, widths: Array) -> Squares:
        key = jax.random.key(num_actions)
        norms = partial(squared_norms, key, world, gain, states)
        deterministic, stochastic = jax.vmap(norms)(widths)
        shape = (NUM_BLOCKS, -1)
        return Squares(
            deterministic[0].reshape(shape).mean(axis=-1),
            stochastic.reshape(*stochastic.shape[:2], *shape).mean(axis=-1),
        )

    return blocks(states, jnp.asarray(widths))


def run(num_states: int = 80_000) -> Group:
    """Exponents in the width and in the number of action dimensions.

    Args:
        num_states: Samples; a multiple of the number of blocks.
    """
    world, gain = shared_shaft(1)
    draw = jax.jit(partial(discounted_states, num_states=num_states))
    states = draw(jax.random.key(0), world, gain)
    gradient = jax.jit(jax.grad(world.objective))(gain)
    norm = float(jnp.vdot(gradient, gradient))
    found = [measure(m, states, WIDTHS if m == SWEPT else NARROW) for m in DIMENSIONS]
    width_checks, width_rows = _widths(found[DIMENSIONS.index(SWEPT)], norm)
    dimension_checks, dimension_rows = _dimensions(found, norm)
    return Group(
        "Section 6: the variance of the stochastic policy gradient",
        (*width_checks, *dimension_checks),
        (*width_rows, *dimension_rows),
    )


def _mean(blocks: Any) -> Slope:
    """Mean over blocks, and its standard error."""
    blocks = np.asarray(blocks)
    return Slope(float(blocks.mean()), float(blocks.std(ddof=1) / np.sqrt(blocks.size)))


def _ratio(above: np.ndarray, below: np.ndarray) -> Slope:
    """Ratio of two means over the same blocks, and its standard error."""
    ratio = above.mean() / below.mean()
    return Slope(float(ratio), _mean(above - ratio * below).error / float(below.mean()))


def _widths(squares: Squares, norm: float) -> tuple[tuple[Check, ...], tuple[Point, ...]]:
    """The exponent of sigma, fitted in each block."""
    checks, rows = [], []
    name = "sigma, width of the policy (action units)", "variance of one sample of the gradient"
    variances = np.asarray(squares.stochastic) - norm
    for reading, (words, power) in enumerate(READINGS.items()):
        fits = [
            fitted_power(WIDTHS, variances[:, reading, block], next_term=2).value
            for block in range(NUM_BLOCKS)
        ]
        checks.append(
            exponent(
                f"variance/width/{_slug(words)}",
                f"score times ({words}): the variance goes like sigma^{power:g}",
                _mean(fits),
                power,
            )
        )
        means = [_mean(variances[k, reading]) for k in range(len(WIDTHS))]
        rows += points(*name, f"score times ({words})", WIDTHS, *map(list, zip(*means)))
    flat = _mean(np.asarray(squares.deterministic) - norm)
    rows += points(*name, "deterministic", WIDTHS, *flat)
    rows += guide(*name, "sigma^-2", WIDTHS, variances[-1, 0].mean(), -2.0)
    return tuple(checks), tuple(rows)


def _slug(words: str) -> str:
    return words.lower().replace(" - ", "-minus-")


def _dimensions(found: list[Squares], norm: float) -> tuple[tuple[Check, ...], tuple[Point, ...]]:
    """The exponent of m, and the ratio that the closed form of Gaussian moments gives."""
    deterministic = np.array([squares.deterministic for squares in found])
    stochastic = np.array([squares.stochastic[-1] for squares in found])
    variance = stochastic - norm
    squares = deterministic.mean(axis=1)
    constant = fitted_power(DIMENSIONS, squares - norm)
    growth = _mean([fitted_power(DIMENSIONS, row).value for row in variance[:, 0].T])
    ratios = [_ratio(*pair) for pair in zip(stochastic[:, 1], deterministic, strict=True)]
    checks = (
        check(
            "variance/dimension/deterministic",
            "m motors on one shaft: the variance of the deterministic estimate does not depend on "
            "m: fitted exponent",
            constant.value,
            0.0,
            rounding(np.max(squares / (squares - norm))),
        ),
        exponent(
            "variance/dimension/q",
            "on the same states the variance of score times Q grows like m",
            growth,
            1.0,
        ),
        check(
            "variance/dimension/q-minus-v",
            "with the baseline V the mean square of the stochastic estimate is m + 2 times that of "
            f"the deterministic one (m = {', '.join(map(str, DIMENSIONS))})",
            [ratio.value for ratio in ratios],
            np.array(DIMENSIONS) + 2,
            [SIGMAS * ratio.error for ratio in ratios],
        ),
    )
    name = "m, action dimensions", "variance over that of the deterministic estimate"
    rows = []
    for reading, words in enumerate(READINGS):
        means = [_mean(variance[k, reading]) for k in range(len(DIMENSIONS))]
        flat = (deterministic - norm).mean(axis=1)
        over = [(mean.value / d, mean.error / d) for mean, d in zip(means, flat, strict=True)]
        rows += points(*name, f"score times ({words})", DIMENSIONS, *map(list, zip(*over)))
    largest = variance[-1, 0].mean() / (deterministic - norm)[-1].mean()
    return checks, (*rows, *guide(*name, "m", DIMENSIONS, largest, 1.0))
