"""An Equinox network as the controller of the regulator: `policies.from_equinox`.

COPDAC-Q, `alpha_w` 0.03, `alpha_v` 0.01, `alpha_theta` 0.001, noise of width 0.5. The module's
arrays are the first weights of all runs.

    python examples/equinox_network.py
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import tyro

import detpg
from detpg.algorithms import COPDACQ
from detpg.environments import LQR
from detpg.policies import from_equinox

NUM_EPISODES = 32
WORLD = LQR()
MODULE = eqx.nn.MLP(2, 1, width_size=16, depth=1, activation=jnp.tanh, key=jax.random.key(0))
POLICY = from_equinox(MODULE)
RATES = {"alpha_w": 0.03, "alpha_v": 0.01, "alpha_theta": 0.001}
LEARNER = COPDACQ.create(WORLD.spec, policy=POLICY, sigma=0.5, **RATES)


def train(key, steps):
    """The mean return before and after."""
    train_key, episodes_key = jax.random.split(key)
    keys = jax.random.split(episodes_key, NUM_EPISODES)

    def earned(state):
        return jnp.mean(jax.vmap(lambda k: detpg.greedy_return(LEARNER, WORLD, k, state))(keys))

    state, _ = detpg.train(LEARNER, WORLD, train_key, steps)
    before = earned(detpg.begin(LEARNER, WORLD, train_key).learner)
    return before, earned(state.learner)


def main(steps: int = 50_000, seeds: int = 4):
    """Trains and prints what it earned.

    Args:
        steps: Environment steps of each run.
        seeds: Runs, side by side.
    """
    keys = jax.random.split(jax.random.key(0), seeds)
    run = jax.jit(jax.vmap(train, in_axes=(0, None)), static_argnums=1)
    before, after = map(np.asarray, run(keys, steps))
    print(f"return before: {before.mean():.1f} +- {before.std():.1f}")
    print(f"return after:  {after.mean():.1f} +- {after.std():.1f}")
    return before, after


if __name__ == "__main__":
    tyro.cli(main)
