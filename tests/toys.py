"""Small worlds and learners whose every number is known."""

import dataclasses
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from detpg.environments import LQR
from detpg.experience import Experience
from detpg.types import EnvironmentSpec, check_hyper, hyper


class ChainState(eqx.Module):
    """How far along the chain, and a number drawn at the reset that tells episodes apart."""

    position: jax.Array
    label: jax.Array


class Chain(eqx.Module):
    """0 -> 1 -> ... -> length, where it terminates; each step earns its position plus one."""

    length: int = eqx.field(static=True, default=3)
    time_limit: int = eqx.field(static=True, default=100)

    @property
    def spec(self):
        return EnvironmentSpec("chain", 2, 1, (-1.0,), (1.0,), self.time_limit, 0.9)

    def initial(self, key):
        return ChainState(jnp.asarray(0, dtype=int), jax.random.uniform(key, dtype=float))

    def transition(self, key, state, action):
        return ChainState(state.position + 1, state.label)

    def reward(self, state, action, next_state):
        return next_state.position.astype(float)

    def terminated(self, state):
        return state.position >= self.length

    def observe(self, state):
        return jnp.stack([state.position.astype(float), state.label])


class ShortLQR(LQR):
    """The regulator with episodes of three steps."""

    @property
    def spec(self):
        return dataclasses.replace(super().spec, time_limit=3)


class Recorder(eqx.Module):
    """Counts its updates, acts at random around the count, and logs what it was given."""

    rate: jax.Array = hyper("added to the count at every update", 1.0, 0.0, 10.0)
    equations: ClassVar[str] = "none: a probe"

    def __check_init__(self):
        check_hyper(self)

    @classmethod
    def create(cls, spec, **options):
        return cls(**options)

    @property
    def experience(self):
        return Experience()

    def init(self, key):
        return {"count": jnp.zeros((), dtype=float)}

    def act(self, key, state, observation):
        return state["count"] + jax.random.uniform(key, (1,), dtype=float)

    def update(self, key, state, transition):
        info = {"transition": transition, "key": jax.random.key_data(key)}
        return {"count": state["count"] + self.rate}, info

    def greedy(self, state, observation):
        return jnp.reshape(state["count"], (1,))
