"""A policy with enough structure to tell a product of Jacobians from its neighbours."""

import dataclasses

import jax
import jax.numpy as jnp


@dataclasses.dataclass(frozen=True)
class TwoLayers:
    """mu_theta(s) = outer tanh(inner s) + shift: 2 observations, 3 actions."""

    def init(self, key):
        keys = jax.random.split(key, 3)
        shapes = {"inner": (4, 2), "outer": (3, 4), "shift": (3,)}
        return {
            name: jax.random.normal(k, shape, dtype=float)
            for k, (name, shape) in zip(keys, shapes.items())
        }

    def __call__(self, theta, observation):
        return theta["outer"] @ jnp.tanh(theta["inner"] @ observation) + theta["shift"]
