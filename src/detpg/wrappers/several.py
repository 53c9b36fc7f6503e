"""One learner in several worlds: its parameters are shared, each world has traces of its own."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree


def of_each_world(state: PyTree) -> PyTree:
    """For each leaf of a learner's state, whether it belongs to an episode (`types.of_episode`)."""
    leaves, structure = jax.tree.flatten(state)
    flags = _flags(state)
    if len(flags) != len(leaves):
        raise ValueError("The learner's state has fields that are no part of its tree.")
    return jax.tree.unflatten(structure, flags)


def _flags(node: Any, of_episode: bool = False) -> list[bool]:
    """In the order of `jax.tree.leaves`."""
    if isinstance(node, eqx.Module):
        fields = [f for f in node.__dataclass_fields__.values() if not f.metadata.get("static")]
        marked = [(getattr(node, f.name), bool(f.metadata.get("of_episode"))) for f in fields]
        return [flag for value, mark in marked for flag in _flags(value, of_episode or mark)]
    inside = jax.tree.leaves(node, is_leaf=lambda x: isinstance(x, eqx.Module))
    return [
        flag
        for part in inside
        for flag in (_flags(part, of_episode) if isinstance(part, eqx.Module) else [of_episode])
    ]


def several_worlds(state: PyTree, num: int) -> PyTree:
    """A fresh state with `num` copies, on a leading axis, of what belongs to an episode."""
    mask = of_each_world(state)
    return jax.tree.map(
        lambda leaf, each: jnp.broadcast_to(leaf, (num, *leaf.shape)) if each else leaf, state, mask
    )
