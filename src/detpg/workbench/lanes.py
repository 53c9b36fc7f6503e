"""Learners with memories, each on a thread of its own: side by side they would share one core.

A state of several learners has a leading axis of seeds in all but `memory`, a tuple of rings: they
are given away to the compiled step, written in place and never stacked.
"""

import dataclasses
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import jax
import jax.numpy as jnp

from detpg.machine import cores

State = TypeVar("State")


def lane(state: State, i: int) -> State:
    """The state of one learner."""
    bare: Any = dataclasses.replace(state, memory=None)  # pyright: ignore[reportArgumentType]
    one = jax.tree.map(lambda leaf: leaf[i], bare)
    return dataclasses.replace(one, memory=getattr(state, "memory")[i])  # noqa: B009


def joined(lanes: list[State]) -> State:
    """The states of all learners as one."""
    bare = [dataclasses.replace(one, memory=None) for one in lanes]  # pyright: ignore
    whole: Any = jax.tree.map(lambda *leaves: jnp.stack(leaves), *bare)
    memories = tuple(getattr(one, "memory") for one in lanes)  # noqa: B009
    return dataclasses.replace(whole, memory=memories)


def each(run: Callable[[int], State], num: int) -> list[State]:
    """What a function gives for every learner; compiled programs run on all cores at once."""
    if num == 1:
        return [run(0)]
    with ThreadPoolExecutor(min(num, cores())) as threads:
        return list(threads.map(run, range(num)))
