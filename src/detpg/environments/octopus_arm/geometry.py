"""Where a point lies as seen from the octopus arm, and the arm turned about its base."""

from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from detpg.environments.octopus_arm.body import Arm, Body, nodes
from detpg.types import Number

Point = Float[Array, "2"]


def base_centre(body: Body) -> Point:
    """Around which the base turns."""
    return jnp.stack([body.base_x[0, 0], body.base_y[0, 0]])


def distance(body: Body, arm: Arm, point: Point) -> Number:
    """Distance from a point to the nearest of the 2S + 2 nodes."""
    x, y = nodes(body, arm)
    square = jnp.min((x - point[0]) ** 2 + (y - point[1]) ** 2)
    # On a node itself a distance has no slope; 0 stands for it.
    return jnp.where(square == 0, square, jnp.sqrt(jnp.where(square == 0, 1.0, square)))


def touches(body: Body, arm: Arm, point: Point) -> Bool[Array, ""]:
    """Whether a point lies in a compartment: whether its outline winds around the point."""
    x, y = nodes(body, arm)
    return winds(x - point[0], y - point[1]).any()


def winds(x: Any, y: Any) -> Any:
    """Whether the outline of each compartment winds around the origin; for NumPy and JAX arrays."""
    (upper_x, lower_x), (upper_y, lower_y) = x, y
    corners = [(upper_x[:-1], upper_y[:-1]), (upper_x[1:], upper_y[1:])]
    corners += [(lower_x[1:], lower_y[1:]), (lower_x[:-1], lower_y[:-1])]
    winding = 0
    for (from_x, from_y), (to_x, to_y) in zip(corners, (*corners[1:], corners[0])):
        # Edges count that cross the height of the origin on its right.
        turn = from_x * to_y - to_x * from_y
        up = (from_y <= 0) & (to_y > 0) & (turn > 0)
        down = (from_y > 0) & (to_y <= 0) & (turn < 0)
        winding += up.astype(int) - down.astype(int)
    return winding != 0


def turned(body: Body, arm: Arm, angle: Number) -> Arm:
    """A resting arm turned stiffly about the centre of its base, counter-clockwise."""
    base_x, base_y = base_centre(body)
    x, y, cos, sin = arm.x - base_x, arm.y - base_y, jnp.cos(angle), jnp.sin(angle)
    turned_x, turned_y = base_x + cos * x - sin * y, base_y + sin * x + cos * y
    # Not turned at all means equal to the last bit: the areas at rest are.
    x, y = jnp.where(angle == 0, arm.x, turned_x), jnp.where(angle == 0, arm.y, turned_y)
    return Arm(arm.theta + angle, arm.omega, x, y, arm.vx, arm.vy)
