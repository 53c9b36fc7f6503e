"""The octopus arm's targets: by name, of one's own, or drawn anew for each episode."""

import math
import warnings
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import PRNGKeyArray

from detpg.environments.octopus_arm.body import Arm, Body
from detpg.environments.octopus_arm.geometry import Point, base_centre, distance, winds
from detpg.environments.octopus_arm.parameters import OctopusParameters
from detpg.types import Number, strong

# For six segments; the arm's length scales them.
TARGETS: dict[str, tuple[float, float]] = {
    "default": (3.6, 3.0),
    "near": (3.0, 3.0),
    "below": (5.0, -2.0),
    "above": (0.0, 5.0),
    "behind": (-4.0, 0.0),
}
# RL-Library's target for its ten segments, as it is.
RL_LIBRARY_TARGET = (6.0, 5.0)

CANDIDATES = 32


# Between two angles of the start at which a target is looked for on the arm, rad.
FINE = 0.02


def place(
    target: str | Point | Sequence[float],
    parameters: OctopusParameters,
    start_noise: Number | None,
) -> Point:
    """The target's coordinates; warns of one that is out of reach.

    Args:
        target: Its name, or x and y.
        parameters: Of the arm.
        start_noise: Greatest angle of the start; None for a target that no episode has.

    Raises:
        ValueError: An unknown name, no two finite numbers, or a target that the arm can start on.
    """
    if isinstance(target, str):
        if target not in (*TARGETS, "rl-library"):
            names = ", ".join((*TARGETS, "rl-library"))
            raise ValueError(f"target {target!r} is unknown: choose one of {names}, or give x, y.")
        scale = parameters.num_segments / 6
        target = [scale * x for x in TARGETS[target]] if target in TARGETS else RL_LIBRARY_TARGET
    try:
        point = strong(target)
    except (TypeError, ValueError):
        point = strong(())
    if point.shape != (2,) or not (isinstance(point, Tracer) or np.isfinite(point).all()):
        raise ValueError(f"target {target} is no point: give two finite numbers, x and y.")
    if start_noise is None:
        return point
    if not any(isinstance(x, Tracer) for x in jax.tree.leaves((point, parameters, start_noise))):
        _check_place(point, parameters, float(start_noise))
    return point


def _check_place(point: Point, parameters: OctopusParameters, start_noise: float) -> None:
    where, sides = f"target ({point[0]:g}, {point[1]:g})", _sides(parameters)
    centre = sides[:, 0].mean()
    seen = complex(*point) - centre
    half = math.ceil(start_noise / FINE)
    for turn in start_noise * np.arange(-half, half + 1) / max(half, 1):
        away = (sides - centre) * np.exp(1j * turn) - seen
        if winds(away.real, away.imag).any():
            raise ValueError(f"{where} is where the arm starts: place it elsewhere.")
    if abs(seen) > reach(parameters):
        words = f"{where} is {abs(seen):.2f} from the base; the arm stretches to about"
        warnings.warn(f"{words} {reach(parameters):.2f}.", stacklevel=2)


def reach(parameters: OctopusParameters) -> float:
    """How far the straight arm stretches: its length where its muscles are in balance.

    With every transversal muscle fully active and no other, the pressure p of a compartment of
    width w and length l = area / w balances each longitudinal muscle, f_l = p w, and the pressures
    of the two compartments beside a transversal muscle balance it, f_t = 2 p l. The published arms
    get 5% less far than that (A), or 5% further (B), since they swing.
    """
    sides = _sides(parameters)
    length, width = np.abs(np.diff(sides, axis=1)).mean(axis=0), np.abs(sides[0] - sides[1])
    area, width = length * (width[1:] + width[:-1]) / 2, width[1:]
    least, passive = float(parameters.muscle_min_length), float(parameters.muscle_passive)
    full = passive + float(parameters.muscle_active)
    compartments = np.where(np.arange(len(length)) == len(length) - 1, 1, 2)
    short, long = length, 10 * length
    for _ in range(50):
        middle = (short + long) / 2
        pull = width**2 / (2 * length) * passive * np.maximum(middle / length - least, 0)
        squeeze = width * full * np.maximum(area / (middle * width) - least, 0)
        grows = compartments * middle**2 * pull < area * squeeze
        short, long = np.where(grows, middle, short), np.where(grows, long, middle)
    return float(short.sum())


def _sides(parameters: OctopusParameters) -> np.ndarray:
    """The nodes at rest, upper and lower, as complex numbers."""
    sides = np.stack([parameters.upper, parameters.lower]).astype(np.float64)
    return sides[..., 0] + 1j * sides[..., 1]


def draw(key: PRNGKeyArray, body: Body, arm: Arm) -> Point:
    """A target within reach: uniform in the ring from 0.2 to 0.9 of a straight arm's length.

    Of some points, the first that keeps clear of the arm is taken.
    """
    radius_key, angle_key = jax.random.split(key)
    length, dtype = jnp.sum(jnp.mean(body.length, axis=0)), arm.x.dtype
    square = jax.random.uniform(radius_key, (CANDIDATES,), dtype, 0.2**2, 0.9**2)
    angle = jax.random.uniform(angle_key, (CANDIDATES,), dtype, 0.0, 2 * jnp.pi)
    around = jnp.stack([jnp.cos(angle), jnp.sin(angle)], axis=1)
    points = base_centre(body)[None] + length * jnp.sqrt(square)[:, None] * around
    away = jax.vmap(distance, in_axes=(None, None, 0))(body, arm, points)
    # Every point of a rectangle is within half its length and width of a corner.
    return points[jnp.argmax(away > (jnp.max(body.length) + jnp.max(body.width)) / 2)]
