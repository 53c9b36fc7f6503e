"""What a step of the world does to a learner: the one place that every loop learns in.

In: a learner, and what just happened in its worlds. Out: the learner after it, and its memory.
Next: the loop (`detpg.training`, `detpg.replaying`, the host's) chooses the next action.
"""

from typing import Protocol, cast

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int, PRNGKeyArray, PyTree

from detpg.experience import Experience, Recalled
from detpg.memory import Memory, empty, recall
from detpg.types import Action, Algorithm, EnvironmentSpec, Observation, Transition


class Recalling(Protocol):
    """What a learner of recalled batches has besides an `Algorithm`'s functions.

    `roam` acts until there is enough to learn from, `follow` carries on what belongs to the episode
    or counts each transition once; neither learns. `update` takes a `Recalled`.
    """

    def roam(self, key: PRNGKeyArray, state: PyTree, observation: Observation) -> Action: ...

    def follow(self, key: PRNGKeyArray, state: PyTree, transition: Transition) -> PyTree: ...

    def update(
        self, key: PRNGKeyArray, state: PyTree, transition: Recalled
    ) -> tuple[PyTree, PyTree]: ...


def recalling(algorithm: Algorithm) -> Recalling:
    """The same learner, of which its `experience` says that it recalls."""
    return cast("Recalling", algorithm)


def memory_of(
    algorithm: Algorithm, spec: EnvironmentSpec, steps: int, worlds: int = 1
) -> Memory | None:
    """An empty memory for a learner that recalls; None for one that does not.

    Args:
        algorithm: The learner.
        spec: Of its world.
        steps: That it will take: a memory holds no more than that.
        worlds: Side by side.
    """
    taken = algorithm.experience
    if taken.kind != "recalled":
        return None
    capacity = min(taken.capacity, steps)
    return empty(capacity, spec.observation_size, spec.action_size, worlds)


def lesson(algorithm: Algorithm, transitions: Transition) -> Transition | Recalled:
    """Transitions on a leading axis as the learner's `update` takes them: rows of one step."""
    if algorithm.experience.kind != "recalled":
        return transitions
    return Recalled(
        transitions.observation,
        transitions.action,
        transitions.reward[:, None],
        transitions.next_observation,
        transitions.terminated,
        steps=jnp.ones_like(transitions.terminated, dtype=int),
    )


def choose(
    algorithm: Algorithm,
    key: PRNGKeyArray,
    learner: PyTree,
    observation: Observation,
    step: Int[Array, ""],
) -> Action:
    """The next action: the learner's own, or anywhere in the box while it only gathers."""
    taken = algorithm.experience
    own = algorithm.act(key, learner, observation)
    if taken.warm_up == 0:
        return own
    anywhere = recalling(algorithm).roam(key, learner, observation)
    return jnp.where(step < taken.warm_up, anywhere, own)


def learn(
    algorithm: Algorithm,
    key: PRNGKeyArray,
    learner: PyTree,
    memory: Memory,
    ready: Bool[Array, ""],
    times: int = 1,
) -> tuple[PyTree, PyTree]:
    """Updates on recalled batches, or none yet.

    Args:
        algorithm: A learner that recalls.
        key: Of the draws and the updates.
        learner: Its state.
        memory: Read and not written.
        ready: Whether there is enough to learn from.
        times: Steps of the world that these updates are for.

    Returns:
        The learner's state, and the diagnostics of the last update; zeros where there was none.
    """
    taken: Experience = algorithm.experience

    def one(learner: PyTree, key: PRNGKeyArray) -> tuple[PyTree, PyTree]:
        recall_key, update_key = jax.random.split(key)
        batch = recall(recall_key, memory, taken.batch, taken.n)
        return algorithm.update(update_key, learner, batch)

    keys = jax.random.split(key, taken.updates * times)
    _, like = jax.eval_shape(one, learner, keys[0])
    nothing = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), like)

    def updated() -> tuple[PyTree, PyTree]:
        if len(keys) == 1:
            return one(learner, keys[0])
        after, info = jax.lax.scan(one, learner, keys)
        return after, jax.tree.map(lambda x: x[-1], info)

    return jax.lax.cond(ready, updated, lambda: (learner, nothing))
