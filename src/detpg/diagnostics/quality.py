"""Bias, variance and cosine of an actor's direction against the exact gradient."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray, PyTree

from detpg import trees
from detpg.checks import shapes
from detpg.diagnostics.gradients import PolicyGradient
from detpg.types import Number

NUM_RESAMPLES = 1_000
SIDE_BY_SIDE = 50

Vector = Float[Array, "feat"]
Rows = Float[Array, "batch feat"]


class DirectionQuality(eqx.Module):
    """What sampled directions are worth as estimates of grad_theta J.

    Noise alone makes a squared length too long and a cosine too small. What says "corrected" had
    this removed: twice the statistic less its mean over bootstrap resamples. It may therefore lie
    a little outside its range, a squared bias below 0 or a cosine above 1.

    Attributes:
        mean: Mean direction, shaped like theta.
        bias: Mean direction less the exact gradient.
        bias_error: Its standard error, component by component: that of the mean and that of the
            exact gradient's rollouts, added in squares.
        variance: Sum over components of the variance of one sampled direction.
        variance_error: Its standard error (delta method).
        bias_squared: Squared length of the bias, corrected.
        bias_squared_error: Its standard error (bootstrap).
        scale: Length of the mean direction along the exact gradient, over the exact gradient's:
            1 where there is no bias; corrected.
        scale_error: Its standard error (bootstrap).
        cosine: Of the angle between mean direction and exact gradient, corrected. No number where
            the exact gradient is zero, like scale.
        cosine_error: Its standard error (bootstrap).
    """

    mean: PyTree
    bias: PyTree
    bias_error: PyTree
    variance: Number
    variance_error: Number
    bias_squared: Number
    bias_squared_error: Number
    scale: Number
    scale_error: Number
    cosine: Number
    cosine_error: Number


def direction_quality(
    directions: PyTree | Callable[..., PyTree],
    exact: PolicyGradient,
    key: PRNGKeyArray,
    *,
    data: PyTree | None = None,
    num_resamples: int = NUM_RESAMPLES,
) -> DirectionQuality:
    """Judges directions, each an independent estimate of grad_theta J.

    Args:
        directions: Sampled directions, trees shaped like theta with a leading axis; or a function
            that makes one direction of one item of the data (a state, a transition, a key).
        exact: grad_theta J, of `rollout_gradient`, `lqr_gradient` or `PolicyGradient(known)`.
        key: Of the bootstrap, which resamples directions, and the exact gradient's rollouts.
        data: What the function is mapped over, a tree with a leading axis on every leaf.
        num_resamples: Of the bootstrap.

    Raises:
        ValueError: Data without a function or a function without data, directions that are not
            shaped like the exact gradient, or fewer than 2 of them.
    """
    if callable(directions) != (data is not None):
        raise ValueError(
            "Directions and data do not fit: give sampled directions alone, or a function of one "
            "sample together with the data to map it over."
        )
    sampled = jax.vmap(directions)(data) if callable(directions) else directions
    _check(sampled, exact.gradient)
    rows, goal = _rows(sampled), trees.to_vector(exact.gradient)
    goals = None if exact.rollouts is None else _rows(exact.rollouts)
    mean = jnp.mean(rows, axis=0)
    squares = jnp.sum((rows - mean[None, :]) ** 2, axis=1)
    noise = jnp.var(rows, axis=0, ddof=1) / len(rows)
    if goals is not None:
        noise = noise + jnp.var(goals, axis=0, ddof=1) / len(goals)

    def resampled(key: PRNGKeyArray) -> Vector:
        ours, theirs = jax.random.split(key)
        again = goal if goals is None else _mean_again(theirs, goals)
        return _statistics(_mean_again(ours, rows), again)

    keys = jax.random.split(key, num_resamples)
    resamples = jax.lax.map(resampled, keys, batch_size=min(num_resamples, SIDE_BY_SIDE))
    corrected = 2 * _statistics(mean, goal) - jnp.mean(resamples, axis=0)
    errors = jnp.std(resamples, axis=0, ddof=1)
    return DirectionQuality(
        mean=trees.like(exact.gradient, mean),
        bias=trees.like(exact.gradient, mean - goal),
        bias_error=trees.like(exact.gradient, jnp.sqrt(noise)),
        variance=jnp.sum(squares) / (len(rows) - 1),
        variance_error=jnp.std(squares, ddof=1) / len(rows) ** 0.5,
        bias_squared=corrected[0],
        bias_squared_error=errors[0],
        scale=corrected[1],
        scale_error=errors[1],
        cosine=corrected[2],
        cosine_error=errors[2],
    )


def _statistics(mean: Vector, goal: Vector) -> Float[Array, "3"]:
    """Squared bias, scale, cosine."""
    bias = mean - goal
    along = trees.dot(mean, goal)
    ours, theirs = trees.dot(mean, mean), trees.dot(goal, goal)
    return jnp.stack([trees.dot(bias, bias), along / theirs, along / jnp.sqrt(ours * theirs)])


def _mean_again(key: PRNGKeyArray, rows: Rows) -> Vector:
    """Mean of as many rows, drawn with replacement."""
    drawn = jax.random.randint(key, (len(rows),), 0, len(rows))
    counts = jnp.bincount(drawn, length=len(rows)).astype(rows.dtype)
    return jnp.dot(counts, rows, precision="highest") / len(rows)


def _rows(sampled: PyTree) -> Rows:
    return jax.vmap(trees.to_vector)(sampled)


def _check(sampled: PyTree, gradient: PyTree) -> None:
    found, wanted = shapes(sampled), shapes(gradient)
    number = found[0][0] if found and found[0] else 0
    fits = jax.tree.structure(sampled) == jax.tree.structure(gradient)
    if not fits or found != [(number, *shape) for shape in wanted]:
        raise ValueError(
            f"Directions of shapes {found} do not fit the exact gradient of shapes {wanted}: give "
            "trees shaped like it with one leading axis over samples."
        )
    if number < 2:
        raise ValueError(f"{number} directions have no variance: give 2 or more.")
