"""The octopus arm's state, as a vector too, and the scales of its numbers."""

import math
from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from detpg.environments.octopus_arm.body import Arm
from detpg.environments.octopus_arm.geometry import Point
from detpg.types import strong

SCALES = ("raw", "unit")
# What the "unit" scale divides by, about the largest seen when random actions are held for a while:
# angle, rate and velocities; positions are divided by half the number of segments.
ANGLE, RATE, VELOCITY = math.pi, 0.1, 0.05


class State(eqx.Module):
    """The arm, and the target of this episode."""

    arm: Arm
    target: Point


def to_vector(arm: Arm) -> Float[Array, "obs"]:
    """theta, omega, then x, y, vx, vy of each upper node, base to tip, and of each lower one."""
    free = jnp.stack([arm.x, arm.y, arm.vx, arm.vy], axis=2)
    return jnp.concatenate([jnp.stack([arm.theta, arm.omega]), free.reshape(-1)])


def from_vector(vector: Float[Array, "obs"]) -> Arm:
    """The arm of such a vector."""
    x, y, vx, vy = jnp.moveaxis(vector[2:].reshape(2, -1, 4), 2, 0)
    return Arm(vector[0], vector[1], x, y, vx, vy)


def scale_of(
    scale: str | Float[Array, "obs"] | Sequence[float], num_segments: int, with_target: bool
) -> Float[Array, "obs"]:
    """Divisors of the observed numbers.

    Raises:
        ValueError: An unknown name, or not one positive number for each observed one.
    """
    size = 2 + 8 * num_segments + 2 * with_target
    half = num_segments / 2
    node = [half, half, VELOCITY, VELOCITY]
    unit = [ANGLE, RATE, *2 * num_segments * node, half, half][:size]
    if isinstance(scale, str):
        if scale not in SCALES:
            raise ValueError(
                f"observation_scale {scale!r} is unknown: choose one of {', '.join(SCALES)}, or "
                f"give {size} divisors."
            )
        return strong(unit if scale == "unit" else [1.0] * size)
    divisors = strong(scale)
    known = np.ones(size) if isinstance(divisors, Tracer) else np.asarray(divisors)
    if divisors.shape != (size,) or not (np.isfinite(known) & (known > 0)).all():
        raise ValueError(
            f"observation_scale has shape {divisors.shape}: give {size} positive numbers."
        )
    return divisors
