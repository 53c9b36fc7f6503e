"""A linear gain on the regulator, trained to near the optimum that the Riccati equation gives.

The controller is a = K s. OPDAC's quadratic critic holds the exact Q of any gain, so that where it
settles there is no bias but that of its step sizes: `alpha_w` 0.01, `alpha_theta` 0.003, noise of
width 0.5.

    python examples/lqr_gain.py
"""

import jax
import jax.numpy as jnp
import numpy as np
import tyro
from scipy.linalg import solve_discrete_are

import detpg
from detpg.algorithms import OPDAC
from detpg.environments import LQR
from detpg.policies import FunctionPolicy

WORLD = LQR()


def gain(K, s):
    """The action K s."""
    return K @ s


def learner():
    """OPDAC, which starts from no control at all."""
    policy = FunctionPolicy(gain, np.zeros((1, 2)))
    return OPDAC.create(WORLD.spec, policy=policy, sigma=0.5, alpha_w=0.01, alpha_theta=0.003)


def riccati():
    """The best gain with the discount: both matrices are scaled by its root."""
    root = np.sqrt(WORLD.gamma)
    A, B = root * np.asarray(WORLD.A, float), root * np.asarray(WORLD.B, float)
    Q, R = np.asarray(WORLD.Q, float), np.asarray(WORLD.R, float)
    P = solve_discrete_are(A, B, Q, R)
    return -np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)


def train(key, steps):
    """The gain learnt, and the exact discounted return before and after."""
    algorithm = learner()
    state, _ = detpg.train(algorithm, WORLD, key, steps)
    K = state.learner.theta
    return K, WORLD.objective(jnp.zeros_like(K)), WORLD.objective(K)


def main(steps: int = 100_000, seeds: int = 4):
    """Trains and prints what was learnt.

    Args:
        steps: Environment steps of each run.
        seeds: Runs, side by side.
    """
    keys = jax.random.split(jax.random.key(0), seeds)
    run = jax.jit(jax.vmap(train, in_axes=(0, None)), static_argnums=1)
    K, before, after = map(np.asarray, run(keys, steps))
    best = riccati()
    print(f"gain learnt:    {K[:, 0].mean(axis=0).round(3)} +- {K[:, 0].std(axis=0).round(3)}")
    print(f"Riccati's gain: {best[0].round(3)}")
    print(f"return before: {before.mean():.3f}")
    print(f"return after:  {after.mean():.3f} +- {after.std():.3f}")
    print(f"return of Riccati's gain: {WORLD.objective(jnp.asarray(best, dtype=float)):.3f}")
    return before, after


if __name__ == "__main__":
    tyro.cli(main)
