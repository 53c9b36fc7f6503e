"""Batches of bandit experience, made beside the training loop."""

import jax
import jax.numpy as jnp
import numpy as np

from detpg.types import Transition


@jax.jit
def batch_of(algorithm, bandit, state, key):
    """The transitions of one update of a batch learner."""
    keys = jax.random.split(key, algorithm.experience.batch)
    start, end = jnp.asarray(False), jnp.asarray(True)
    observation = bandit.observe(start)

    def one(key):
        action = algorithm.act(key, state, observation)
        return Transition(
            observation=observation,
            action=action,
            reward=bandit.reward(start, action, end),
            next_observation=observation,
            next_action=action,
            terminated=end,
        )

    return jax.vmap(one)(keys)


@jax.jit
def update(algorithm, state, transition):
    """One update, compiled once for all values of the hyper-parameters."""
    return algorithm.update(jax.random.key(0), state, transition)


def reward_gradient(bandit, action):
    """Of -(a - a*)^T C (a - a*), in NumPy."""
    C = np.asarray(bandit.C, dtype=np.float64)
    return -2 * C @ (np.asarray(action, dtype=np.float64) - np.asarray(bandit.a_star))
