"""A Flax network as the controller of the regulator: `policies.from_flax`.

OPDAC with a quadratic critic, `alpha_w` 0.01, `alpha_theta` 0.003, noise of width 0.5. Each run
draws its own hidden weights; those of the output are 0, so that it starts from no control.

    python examples/flax_network.py
"""

import flax.linen as nn
import jax
import jax.numpy as jnp
import numpy as np
import tyro

import detpg
from detpg.algorithms import OPDAC
from detpg.environments import LQR
from detpg.policies import from_flax

NUM_EPISODES = 32


class Network(nn.Module):
    """Sixteen tanh units and one linear output, 0 at the start."""

    @nn.compact
    def __call__(self, observation):
        """An action."""
        hidden = nn.tanh(nn.Dense(16)(observation))
        return nn.Dense(1, kernel_init=nn.initializers.zeros)(hidden)


WORLD = LQR()
POLICY = from_flax(Network(), WORLD.spec.observation_size)
LEARNER = OPDAC.create(WORLD.spec, policy=POLICY, sigma=0.5, alpha_w=0.01, alpha_theta=0.003)


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
