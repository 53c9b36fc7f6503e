"""Episodes step by step, pure and unbatched: what an outer loop in another library drives."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int, PRNGKeyArray, PyTree, UInt32

from detpg import trees
from detpg.types import Action, Environment, Number, Observation


class Episode(eqx.Module):
    """Where one world stands.

    Attributes:
        state: Of the environment.
        key: Of all steps of this episode.
        steps: Since the reset.
    """

    state: PyTree
    key: PRNGKeyArray
    steps: Int[Array, ""]


class Outcome(NamedTuple):
    """What one step brings; the observation is the one before any reset."""

    observation: Observation
    reward: Number
    terminated: Bool[Array, ""]
    truncated: Bool[Array, ""]


def begin(environment: Environment, seed: UInt32[Array, ""]) -> tuple[Episode, Observation]:
    """An episode's start; the seed says all that is random in it."""
    start_key, key = jax.random.split(jax.random.key(seed))
    state = environment.initial(start_key)
    return Episode(state, key, jnp.asarray(0, dtype=int)), environment.observe(state)


def advance(environment: Environment, episode: Episode, action: Action) -> tuple[Episode, Outcome]:
    """One step; what has not terminated at the time limit is truncated."""
    key = jax.random.fold_in(episode.key, episode.steps)
    state = environment.transition(key, episode.state, action)
    steps = episode.steps + 1
    terminated = environment.terminated(state)
    outcome = Outcome(
        observation=environment.observe(state),
        reward=environment.reward(episode.state, action, state),
        terminated=terminated,
        truncated=(steps >= environment.spec.time_limit) & ~terminated,
    )
    return Episode(state, episode.key, steps), outcome


def begin_where(
    environment: Environment,
    over: Bool[Array, ""],
    seed: UInt32[Array, ""],
    episode: Episode,
    observation: Observation,
) -> tuple[Episode, Observation]:
    """A new episode where the old one is over, and the old one elsewhere."""
    return trees.where(over, begin(environment, seed), (episode, observation))
