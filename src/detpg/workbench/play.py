"""Episodes of the mean policy, and what the critic said of them."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PRNGKeyArray, PyTree

from detpg import trees
from detpg.learning import lesson
from detpg.types import Action, Algorithm, Environment, Number, Observation, Transition
from detpg.wrappers import Metered, Normalised
from detpg.wrappers.normalised import UNKNOWN


class Played(NamedTuple):
    """Of each learner (first axis) and episode (second).

    Attributes:
        returns: Undiscounted.
        lengths: Steps.
        discounted: Discounted returns; where the time limit cut, the critic's value is added.
        start_values: The critic's values of the first state and action.
    """

    returns: np.ndarray
    lengths: np.ndarray
    discounted: np.ndarray
    start_values: np.ndarray


def worth(learner: Algorithm, state: PyTree, observation: Observation) -> tuple[Action, Number]:
    """The mean action, and the critic's value of it in units of the reward; 0 where it has none."""
    action = learner.greedy(state, observation)
    if learner.experience.kind == "fresh":
        return action, jnp.zeros(())
    tried: Any = Transition(
        observation, action, jnp.zeros(()), observation, action, terminated=jnp.asarray(False)
    )
    if learner.experience.kind == "recalled":
        tried = lesson(learner, jax.tree.map(lambda leaf: leaf[None], tried))
    # Every learner's diagnostics name the value before the update; the update is thrown away.
    _, info = learner.update(jax.random.key(0), state, tried)
    return action, info.value * _unit(learner, state)


def _unit(learner: Any, state: Any) -> Number:
    """What 1 of the critic is in units of the reward."""
    if isinstance(learner, Metered):
        return _unit(learner.algorithm, state.learner)
    if isinstance(learner, Normalised) and learner.rewards:
        deviation = learner.unit(state)
        return jnp.where(deviation < UNKNOWN / 2, deviation, jnp.ones_like(deviation))
    return jnp.ones(())


def discount(learner: Any) -> Any:
    """Gamma of the learner inside; 1 where it has none."""
    while isinstance(learner, (Metered, Normalised)):
        learner = learner.algorithm
    return getattr(learner, "gamma", 1.0)


def episode(
    learner: Algorithm, environment: Environment, key: PRNGKeyArray, state: PyTree
) -> tuple[Array, Array, Array, Array]:
    """One episode: return, length, discounted return with the tail's value, value at the start."""
    start_key, loop_key = jax.random.split(key)
    gamma = discount(learner)

    def body(carry: Any, step: Array) -> tuple[Any, None]:
        world, ended, total, length, earned, weight = carry
        action, _ = worth(learner, state, environment.observe(world))
        next_world = environment.transition(jax.random.fold_in(loop_key, step), world, action)
        reward = environment.reward(world, action, next_world)
        going = jnp.where(ended, jnp.zeros_like(reward), jnp.ones_like(reward))
        counted = jnp.where(ended, jnp.zeros_like(reward), reward)
        weight_now = weight * jnp.where(ended, jnp.ones_like(weight), jnp.full_like(weight, gamma))
        world = trees.where(ended, world, next_world)
        sums = total + counted, length + going, earned + weight * counted, weight_now
        return (world, ended | environment.terminated(world), *sums), None

    zero, one = jnp.zeros(()), jnp.ones(())
    world = environment.initial(start_key)
    start = (world, jnp.asarray(False), zero, zero, zero, one)
    steps = jnp.arange(environment.spec.time_limit)
    (last, terminated, total, length, earned, weight), _ = jax.lax.scan(body, start, steps)
    _, tail = worth(learner, state, environment.observe(last))
    _, value = worth(learner, state, environment.observe(world))
    earned = earned + jnp.where(terminated, jnp.zeros_like(tail), weight * tail)
    return total, length, earned, value


def finite_seeds(learners: PyTree, seeds: int) -> np.ndarray:
    """Whether all numbers of each learner are finite."""
    fine = np.ones(seeds, bool)
    for leaf in jax.tree.leaves(learners):
        if jnp.issubdtype(leaf.dtype, jnp.floating):
            fine &= np.isfinite(np.asarray(leaf)).reshape(seeds, -1).all(axis=1)
    return fine


def without_lost(played: Played, learners: PyTree) -> Played:
    """With NaN for what a lost learner earned: its actions were those of something else."""
    lost = ~finite_seeds(learners, len(played.returns))
    earned = (np.where(lost[:, None], np.nan, found) for found in (played.returns, *played[2:]))
    returns, *others = earned
    return Played(returns, played.lengths, *others)


class Bias(NamedTuple):
    """How much the critic overestimates at the start of episodes; the size of returns."""

    mean: np.ndarray
    scale: np.ndarray


def bias(played: Played) -> Bias:
    """For each learner: mean of value minus discounted return, and their typical size."""
    difference = played.start_values - played.discounted
    scale = np.abs(played.discounted).mean(axis=1) + played.discounted.std(axis=1)
    return Bias(difference.mean(axis=1), scale)
