"""Greedy rollouts: what the deterministic policy earns, exploration not penalised."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray, PyTree

from detpg import trees
from detpg.types import Algorithm, Environment


def greedy_return(
    algorithm: Algorithm, environment: Environment, key: PRNGKeyArray, learner: PyTree
) -> Float[Array, ""]:
    """Undiscounted return of one episode of `algorithm.greedy`, up to the time limit."""
    start_key, loop_key = jax.random.split(key)
    state = environment.initial(start_key)

    def body(
        carry: tuple[PyTree, Bool[Array, ""]], step: Array
    ) -> tuple[tuple[PyTree, Bool[Array, ""]], Float[Array, ""]]:
        state, ended = carry
        action = algorithm.greedy(learner, environment.observe(state))
        next_state = environment.transition(jax.random.fold_in(loop_key, step), state, action)
        reward = environment.reward(state, action, next_state)
        reward = jnp.where(ended, jnp.zeros_like(reward), reward)
        kept = trees.where(ended, state, next_state)
        return (kept, ended | environment.terminated(next_state)), reward

    steps = jnp.arange(environment.spec.time_limit)
    _, rewards = jax.lax.scan(body, (state, jnp.asarray(False)), steps)
    return jnp.sum(rewards)
