"""Arithmetic on parameter trees: any pytree of arrays is one vector of R^n."""

import itertools
import math

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PyTree

from detpg.types import Policy


def add_scaled(tree: PyTree, scale: Float[Array, ""], direction: PyTree) -> PyTree:
    """Tree + scale * direction, leaf by leaf: one step of size `scale`."""
    return jax.tree.map(lambda x, d: x + scale * d, tree, direction)


def polyak(target: PyTree, tau: Float[Array, ""], tree: PyTree) -> PyTree:
    """The target moved towards a tree: (1 - tau) target + tau tree, leaf by leaf."""
    return jax.tree.map(lambda old, new: old + tau * (new - old), target, tree)


def where(condition: Bool[Array, ""], if_true: PyTree, if_false: PyTree) -> PyTree:
    """One of two trees of the same structure, chosen by a scalar condition."""
    return jax.tree.map(lambda a, b: jax.lax.select(condition, a, b), if_true, if_false)


def scale(factor: Float[Array, ""], tree: PyTree) -> PyTree:
    """Factor * tree, leaf by leaf."""
    return jax.tree.map(lambda x: factor * x, tree)


def zero_where(condition: Bool[Array, ""], tree: PyTree) -> PyTree:
    """The tree, or zeros of its shape where a scalar condition holds."""
    return where(condition, zeros_like(tree), tree)


def mean(trees: PyTree) -> PyTree:
    """Mean over the leading axis of every leaf."""
    return jax.tree.map(lambda x: jnp.mean(x, axis=0), trees)


def to_vector(tree: PyTree) -> Float[Array, "feat"]:
    """All leaves raveled and joined, in the order of `jax.tree.leaves`."""
    return jnp.concatenate([jnp.ravel(leaf) for leaf in jax.tree.leaves(tree)])


def like(tree: PyTree, vector: Float[Array, "feat"]) -> PyTree:
    """A vector in the shape of a tree: the inverse of `to_vector`."""
    leaves, structure = jax.tree.flatten(tree)
    ends = list(itertools.accumulate(leaf.size for leaf in leaves))
    parts = [vector[end - leaf.size : end] for leaf, end in zip(leaves, ends, strict=True)]
    shaped = [part.reshape(leaf.shape) for part, leaf in zip(parts, leaves, strict=True)]
    return jax.tree.unflatten(structure, shaped)


def num_parameters(policy: Policy) -> int:
    """n, the length of theta, from the shapes alone."""
    theta = jax.eval_shape(policy.init, jax.random.key(0))
    return sum(math.prod(leaf.shape) for leaf in jax.tree.leaves(theta))


def dot(tree: PyTree, other: PyTree) -> Float[Array, ""]:
    """Inner product of two trees of the same structure."""
    return jnp.dot(to_vector(tree), to_vector(other), precision="highest")


def zeros_like(tree: PyTree) -> PyTree:
    """A tree of the same structure, all zero."""
    return jax.tree.map(jnp.zeros_like, tree)
