"""Learners with memories, each on a thread of its own: side by side they would share one core.

A state of several learners has a leading axis of seeds in all but `memory`, a tuple of rings: they
are given away to the compiled step, written in place and never stacked.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp

from detpg.machine import cores
from detpg.memory import Memory

State = TypeVar("State", bound=Any)


def lane(state: State, i: int) -> State:
    """The state of one learner."""
    one = jax.tree.map(lambda leaf: leaf[i], _with_memory(state, None))
    return _with_memory(one, state.memory[i])


def joined(lanes: list[State]) -> State:
    """The states of all learners as one."""
    bare = [_with_memory(one, None) for one in lanes]
    whole = jax.tree.map(lambda *leaves: jnp.stack(leaves), *bare)
    return _with_memory(whole, tuple(one.memory for one in lanes))


def grown(state: State, capacity: int) -> State:
    """With memories of as many transitions, where they hold fewer; none has wrapped yet."""

    def one(memory: Memory) -> Memory:
        worlds, rows, _ = memory.rows.shape
        more = max(-(-capacity // worlds) + 1 - rows, 0)
        return eqx.tree_at(
            lambda x: x.rows, memory, jnp.pad(memory.rows, ((0, 0), (0, more), (0, 0)))
        )

    return _with_memory(state, tuple(map(one, state.memory)))


def _with_memory(state: State, memory: Any) -> State:
    return eqx.tree_at(lambda x: x.memory, state, memory, is_leaf=lambda x: x is None)


def each(run: Callable[[int], State], num: int) -> list[State]:
    """What a function gives for every learner; compiled programs run on all cores at once."""
    if num == 1:
        return [run(0)]
    with ThreadPoolExecutor(min(num, cores())) as threads:
        return list(threads.map(run, range(num)))
