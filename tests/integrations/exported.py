"""Controllers of every kind, with parameters drawn at random."""

import dataclasses

import jax
import jax.numpy as jnp

from detpg.algorithms import ALGORITHMS
from detpg.features.quadratic import QuadraticFeatures
from detpg.features.tile_coding import TileCoding
from detpg.policies import ConstantPolicy, FeaturePolicy, LinearPolicy, MLPPolicy
from detpg.types import EnvironmentSpec
from detpg.wrappers import Controller, Moments, Normalised

SPEC = EnvironmentSpec(
    "world", 3, 2, (-2.0, -1.0), (2.0, 3.0), 100, 0.99, (-1.0, -1.0, -8.0), (1.0, 1.0, 8.0)
)


@dataclasses.dataclass(frozen=True)
class Own:
    """A user's controller: an angle error, gains, a switch, a root, a norm."""

    def init(self, key):
        return {"gain": jnp.zeros((2, 3)), "bias": jnp.zeros(2)}

    def __call__(self, theta, observation):
        angle = jnp.arctan2(observation[0], observation[1]) + 4 * observation[2]
        angle = jnp.mod(angle + jnp.pi, 2 * jnp.pi) - jnp.pi
        action = theta["gain"] @ observation.at[2].set(angle) + theta["bias"]
        size = jnp.linalg.norm(observation)
        action = jnp.where(size > 1, action / size, action)
        return action.at[1].add(jnp.sqrt(jnp.abs(jnp.sin(observation[0]))))


@dataclasses.dataclass(frozen=True)
class Calling:
    """A user's controller that leaves JAX."""

    def init(self, key):
        return jnp.zeros(2)

    def __call__(self, theta, observation):
        return jax.pure_callback(lambda seen: seen, theta, observation[:2])


tiles = TileCoding.for_environment
POLICIES = {
    "constant": ConstantPolicy(2),
    "linear": LinearPolicy(3, 2),
    "tanh": MLPPolicy(3, 2, (16, 8)),
    "sigmoid": MLPPolicy(3, 2, (16,), "sigmoid", "tanh"),
    "quadratic": FeaturePolicy(QuadraticFeatures(3), 2),
    "tiles": FeaturePolicy(tiles(SPEC, 4, bias=False), 2),
    "wrapped": FeaturePolicy(tiles(SPEC, 5, wrapped=(0,), partition="small", jitter=1.0), 2),
    "hashed": FeaturePolicy(tiles(SPEC, 4, memory=64), 2),
    "own": Own(),
    "calling": Calling(),
}


def drawn(tree):
    """Every number of a learner's state, at random."""
    leaves, structure = jax.tree.flatten(tree)
    keys = jax.random.split(jax.random.key(1), len(leaves))
    return jax.tree.unflatten(structure, [_drawn(*pair) for pair in zip(keys, leaves)])


def _drawn(key, leaf):
    real = jnp.issubdtype(leaf.dtype, jnp.floating)
    return 0.3 * jax.random.normal(key, leaf.shape, leaf.dtype) if real else leaf


def with_policy(name, normalised=False, spec=SPEC, learner="copdac-q"):
    """A controller of a learner that takes a policy."""
    return wrapped(ALGORITHMS[learner].create(spec, policy=POLICIES[name]), normalised, spec)


def wrapped(algorithm, normalised=False, spec=SPEC):
    """The controller of a learner, perhaps with a normaliser that saw large and small numbers."""
    if not normalised:
        return Controller(algorithm, drawn(algorithm.init(jax.random.key(0))), spec.bounds)
    algorithm = Normalised.create(spec, algorithm=algorithm)
    seen = Moments.of(9, jnp.asarray([0.1, -3.0, 500.0]), jnp.asarray([1 / 3, 10**0.5, 1e-2]))
    state = drawn(algorithm.init(jax.random.key(0)))
    state = dataclasses.replace(state, observations=seen)
    return Controller(algorithm, state, spec.bounds)
