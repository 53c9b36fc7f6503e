"""A cart that follows a reference with a force that saturates: mu(s) = tanh(gains . s).

A linear gain with a soft limit is neither linear nor a network: three numbers, with the plant's
limit in them. COPDAC-Q, `alpha_w` 0.1, `alpha_v` 0.05, `alpha_theta` 0.003, noise of width 0.3.
With `alpha_v` 0.01 the baseline lags behind, and some runs diverge.

    python examples/saturating_tracker.py
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import tyro

import detpg
from detpg.algorithms import COPDACQ
from detpg.policies import FunctionPolicy
from detpg.types import EnvironmentSpec

NUM_EPISODES = 64


class Cart(eqx.Module):
    """A unit mass on a rail, pushed by a force of at most 1; steps of 0.1 s.

    Observation: position less reference (m), velocity (m/s). Reward: -(error^2 + 0.05 force^2).
    The reference jumps to a place in [-1, 1] with probability 0.02 in each step; 200 steps.
    """

    friction: jax.Array = eqx.field(default=0.2, converter=jnp.asarray)

    @property
    def spec(self):
        """Two observations, one force."""
        return EnvironmentSpec("cart", 2, 1, (-1.0,), (1.0,), 200, 0.95)

    def initial(self, key):
        """At rest, somewhere; the reference somewhere else."""
        position, reference = jax.random.uniform(key, (2,), minval=-1.0, maxval=1.0)
        return jnp.stack([position, jnp.zeros(()), reference])

    def transition(self, key, state, action):
        """Semi-implicit Euler."""
        position, velocity, reference = state
        force = jnp.clip(action[0], -1.0, 1.0)
        velocity = velocity + 0.1 * (force - self.friction * velocity)
        jump_key, place_key = jax.random.split(key)
        place = jax.random.uniform(place_key, (), minval=-1.0, maxval=1.0)
        reference = jnp.where(jax.random.bernoulli(jump_key, 0.02), place, reference)
        return jnp.stack([position + 0.1 * velocity, velocity, reference])

    def reward(self, state, action, next_state):
        """Of the state before the step."""
        force = jnp.clip(action[0], -1.0, 1.0)
        return -((state[0] - state[2]) ** 2 + 0.05 * force**2)

    def terminated(self, state):
        """Never."""
        return jnp.asarray(False)

    def observe(self, state):
        """The error and the velocity."""
        return jnp.stack([state[0] - state[2], state[1]])


WORLD = Cart()


def saturated(gains, observation):
    """A linear gain, softly limited to [-1, 1]."""
    return jnp.tanh(gains @ observation)


def learner():
    """COPDAC-Q from a weak gain that hardly damps."""
    policy = FunctionPolicy(saturated, np.asarray([[-0.3, -0.1]]))
    rates = {"alpha_w": 0.1, "alpha_v": 0.05, "alpha_theta": 0.003}
    return COPDACQ.create(WORLD.spec, policy=policy, sigma=0.3, **rates)


def train(key, steps):
    """The gains learnt, and the mean return before and after."""
    algorithm = learner()
    train_key, episodes_key = jax.random.split(key)
    keys = jax.random.split(episodes_key, NUM_EPISODES)

    def earned(state):
        return jnp.mean(jax.vmap(lambda k: detpg.greedy_return(algorithm, WORLD, k, state))(keys))

    state, _ = detpg.train(algorithm, WORLD, train_key, steps)
    before = earned(detpg.begin(algorithm, WORLD, train_key).learner)
    return state.learner.theta, before, earned(state.learner)


def main(steps: int = 50_000, seeds: int = 4):
    """Trains and prints what was learnt.

    Args:
        steps: Environment steps of each run.
        seeds: Runs, side by side.
    """
    keys = jax.random.split(jax.random.key(0), seeds)
    run = jax.jit(jax.vmap(train, in_axes=(0, None)), static_argnums=1)
    gains, before, after = map(np.asarray, run(keys, steps))
    print(f"gains: {gains[:, 0].mean(axis=0).round(3)} +- {gains[:, 0].std(axis=0).round(3)}")
    print(f"return before: {before.mean():.2f}")
    print(f"return after:  {after.mean():.2f} +- {after.std():.2f}")
    return before, after


if __name__ == "__main__":
    tyro.cli(main)
