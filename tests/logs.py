"""What a poor behaviour did on the regulator, and the gain that is found in it."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from scipy.linalg import solve_discrete_are

from detpg.algorithms import ALGORITHMS
from detpg.environments import LQR
from detpg.replaying import Logged, learn_from
from detpg.types import Bounds

POOR = ((0.4, -0.3),)  # the best is about (-0.05, -0.90)
ROWS, SEEDS = 5000, 8


def riccati():
    """The gain K of a = K s that is best with the discount, and the world."""
    world = LQR()
    A, B, Q, R = (np.asarray(x, float) for x in (world.A, world.B, world.Q, world.R))
    root = np.sqrt(world.gamma)
    P = solve_discrete_are(root * A, root * B, Q, R)
    return -np.linalg.solve(R + root**2 * B.T @ P @ B, root**2 * B.T @ P @ A), world


def nearness():
    """How far the behaviour's gain is from the best."""
    return np.linalg.norm(np.asarray(POOR) - riccati()[0])


def lqr_log(key, rows=ROWS):
    """Episodes of the default regulator under a poor gain with uniform noise."""
    world = LQR()
    limit = world.spec.time_limit

    def body(state, i):
        action_key, step_key, reset_key = jax.random.split(jax.random.fold_in(key, i), 3)
        state = jnp.where(i % limit == 0, world.initial(reset_key), state)
        noise = jax.random.uniform(action_key, (1,), minval=-1.0, maxval=1.0)
        action = jnp.asarray(POOR) @ state + noise
        following = world.transition(step_key, state, action)
        return following, (state, action, world.reward(state, action, following), following)

    steps = jnp.arange(rows)
    _, columns = jax.lax.scan(body, jnp.zeros(2), steps)
    ends = steps % limit == limit - 1
    flags = jnp.zeros_like(ends), ends
    return Logged(*columns, *flags, steps // limit, Bounds.unbounded(1))


@functools.partial(jax.jit, static_argnames=("early", "more"))
def learnt(learner, early, more):
    """theta from a log of its own for each seed, early and after more steps."""

    def one(key):
        log_key, run_key = jax.random.split(key)
        log = lqr_log(log_key)
        first, _ = learn_from(learner, log, run_key, early)
        then, _ = learn_from(learner, log, run_key, more, first)
        return first.learner.theta, then.learner.theta

    return jax.vmap(one)(jax.random.split(jax.random.key(0), SEEDS))


@functools.cache
def opdac_gains():
    """OPDAC's gain from each of the logs, the best one, and their standard deviation."""
    best, world = riccati()
    learner = ALGORITHMS["opdac"].create(world.spec, alpha_w=0.01, alpha_theta=0.003)
    found = np.asarray(learnt(learner, 10_000, 10_000)[1])[:, 0]
    return found, best[0], found.std(axis=0, ddof=1)
