"""Theorem 1 (eq. 9) on the LQR, where both of its sides are known."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PRNGKeyArray

from detpg import trees
from detpg.actors import deterministic_direction
from detpg.environments import LQR
from detpg.policies import LinearPolicy
from detpg.theorems.record import (
    SIGMAS,
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
from detpg.theorems.worlds import regulator

SIZES = (16, 32, 64, 128, 256, 512, 1024)  # states per estimate
NUDGES = tuple(0.1 * 0.5**k for k in range(7))  # of one entry of the gain


def run(num_estimates: int = 64) -> Group:
    """Closed form, finite differences and samples of eq. 9 against the gradient of J.

    Args:
        num_estimates: Independent estimates of each size.
    """
    world, gain = regulator()
    exact = jax.jit(jax.grad(world.objective))(gain)
    in_closed_form = _closed_form(world, gain, exact)
    differences, difference_points = _finite_differences(world, gain, exact)
    samples, sample_points = _samples(world, gain, exact, num_estimates)
    return Group(
        "Theorem 1: the deterministic policy gradient",
        (in_closed_form, differences, *samples),
        (*difference_points, *sample_points),
    )


def _closed_form(world: LQR, gain: Array, exact: Array) -> Check:
    """The slope of Q is linear in s: its mean against s needs only the second moment of rho."""

    @jax.jit
    def theorem(gain: Array) -> tuple[Array, Array]:
        def slope(s: Array) -> Array:
            return jax.grad(world.action_value, argnums=2)(gain, s, jnp.dot(gain, s))

        moment = world.state_moment(gain)
        slopes = jax.vmap(slope)(jnp.eye(moment.shape[0], dtype=gain.dtype)).T
        return jnp.dot(slopes, moment, precision="highest"), moment

    value, moment = theorem(gain)
    return check(
        "theorem-1/closed-form",
        "E over rho^mu of grad mu grad_a Q, in closed form, is grad J: relative error 0 to "
        "rounding",
        relative_error(value, exact),
        0.0,
        rounding(np.linalg.cond(moment)),
    )


def _finite_differences(world: LQR, gain: Array, exact: Array) -> tuple[Check, tuple[Point, ...]]:
    """Central differences of J: their error is of second order in the nudge."""
    basis = jnp.eye(gain.size, dtype=gain.dtype).reshape(-1, *gain.shape)

    @jax.jit
    def central(nudge: Array) -> Array:
        ends = [jax.vmap(world.objective)(gain[None] + s * nudge * basis) for s in (1.0, -1.0)]
        return (ends[0] - ends[1]) / (2 * nudge)

    errors = [relative_error(central(jnp.asarray(h)), exact) for h in NUDGES]
    order = fitted_power(NUDGES, errors, next_term=2)
    made = exponent(
        "theorem-1/finite-differences",
        "the error of central differences of J against grad J falls as the square of the nudge",
        order,
        2.0,
    )
    name = "nudge of one entry of the gain", "relative error of finite differences"
    line = guide(*name, "square of the nudge", NUDGES, errors[-1], 2.0)
    return made, (*points(*name, "finite differences", NUDGES, errors), *line)


def discounted_states(
    key: PRNGKeyArray, world: LQR, gain: Float[Array, "act obs"], num_states: int
) -> Float[Array, "points obs"]:
    """Independent states from (1 - gamma) rho^mu.

    Each is the last of a run of its own, which goes on after every step with probability gamma.
    """
    start_key, age_key, loop_key = jax.random.split(key, 3)
    ages = jax.random.geometric(age_key, 1 - world.gamma, (num_states,)) - 1
    states = jax.vmap(world.initial)(jax.random.split(start_key, num_states))

    def step(carry: tuple[Int[Array, ""], Array]) -> tuple[Int[Array, ""], Array]:
        t, states = carry
        keys = jax.random.split(jax.random.fold_in(loop_key, t), num_states)
        moved = jax.vmap(lambda k, s: world.transition(k, s, jnp.dot(gain, s)))(keys, states)
        return t + 1, jnp.where((t < ages)[:, None], moved, states)

    oldest = jnp.max(ages)
    zero = jnp.zeros((), dtype=ages.dtype)
    return jax.lax.while_loop(lambda carry: carry[0] < oldest, step, (zero, states))[1]


def _samples(
    world: LQR, gain: Array, exact: Array, num_estimates: int
) -> tuple[tuple[Check, ...], tuple[Point, ...]]:
    """The mean of grad mu grad_a Q at sampled states: no bias, and an error ~ N^-1/2."""
    policy = LinearPolicy(*gain.shape[::-1])

    @jax.jit
    def directions(key: PRNGKeyArray) -> Array:
        def one(s: Array) -> Array:
            direction = deterministic_direction(
                policy, gain, s, lambda a: world.action_value(gain, s, a)
            )
            return trees.to_vector(direction) / (1 - world.gamma)

        return jax.vmap(one)(discounted_states(key, world, gain, num_estimates * sum(SIZES)))

    drawn = np.asarray(directions(jax.random.key(0)))
    truth = np.ravel(np.asarray(exact))
    error = drawn.std(axis=0, ddof=1) / np.sqrt(len(drawn))
    mean = check(
        "theorem-1/samples",
        f"the mean of grad mu grad_a Q over {len(drawn)} states drawn from rho^mu is grad J, "
        "entry by entry, within 4 standard errors",
        drawn.mean(axis=0),
        truth,
        SIGMAS * error,
    )
    rms, rms_error = _root_mean_squares(drawn, truth, num_estimates)
    power = fitted_power(SIZES, rms, rms_error)
    rate = exponent(
        "theorem-1/monte-carlo-rate",
        "the error of an estimate from N states falls as N^-1/2",
        power,
        -0.5,
    )
    name = "N, states of an estimate", "relative error of the sampled gradient"
    measured = points(*name, "sampled gradient", SIZES, rms, rms_error)
    return (mean, rate), (*measured, *guide(*name, "N^-1/2", SIZES, rms[-1], -0.5))


def _root_mean_squares(
    drawn: np.ndarray, truth: np.ndarray, num_estimates: int
) -> tuple[np.ndarray, np.ndarray]:
    """Relative error of estimates of each size, from states of their own; its standard error."""
    blocks = np.split(drawn, np.cumsum([num_estimates * size for size in SIZES])[:-1])
    means = [block.reshape(num_estimates, -1, truth.size).mean(axis=1) for block in blocks]
    squares = np.array([np.sum((mean - truth) ** 2, axis=-1) for mean in means])
    rms = np.sqrt(squares.mean(axis=1))
    # d rms = d (rms^2) / (2 rms)
    error = squares.std(axis=1, ddof=1) / np.sqrt(num_estimates) / (2 * rms)
    return rms / np.linalg.norm(truth), error / np.linalg.norm(truth)
