"""The octopus arm's forces: from an arm under an action to its rates of change.

Muscles are damped springs whose stiffness follows their activation, compartments keep their area,
water drags at the nodes, the base is turned. Axes as in `body`.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from detpg.environments.octopus_arm.body import (
    Arm,
    Body,
    Pair,
    Part,
    across,
    along,
    base,
    diagonals,
    nodes,
    signed_area,
)

STEEPEST = 1e-6  # below it the slope of the root grows no more; its value is not changed


class Pull(eqx.Module):
    """What an action does: the stiffness of each muscle, and the torque on the base."""

    longitudinal: Part
    transversal: Part
    torque: Float[Array, "*#batch"]


def activate(body: Body, action: Float[Array, "act *#batch"]) -> Pull:
    """The pull of an action: activations are capped to [0, 1], base actions are not."""
    dorsal, transversal, ventral = (jnp.clip(action[2 + i :: 3], 0.0, 1.0) for i in range(3))

    def stiffness(*activation: Array) -> Part:
        return body.known["muscle_passive"] + body.known["muscle_active"] * jnp.stack(activation)

    return Pull(
        longitudinal=body.strength * stiffness(dorsal, ventral),
        transversal=body.width * stiffness(transversal),
        torque=body.known["torque"][0, 0] * (action[0] - action[1]),
    )


def derivative(body: Body, pull: Pull, arm: Arm) -> Arm:
    """Rates of change of the arm: velocities, and forces over masses."""
    base_x, base_y = base(body, arm)
    x, y = nodes(body, arm)
    omega = arm.omega[None, None]
    vx = jnp.concatenate([-omega * base_y, arm.vx], axis=1)
    vy = jnp.concatenate([omega * base_x, arm.vy], axis=1)

    edge, rates = (along(x), along(y)), (along(vx), along(vy))
    long = _tension(body, pull.longitudinal, body.length, body.strength, edge, rates)
    chord, rates = (across(arm.x), across(arm.y)), (across(arm.vx), across(arm.vy))
    wide = _tension(body, pull.transversal, body.width, body.width, chord, rates)
    rising, falling = diagonals(x, y)
    press = _pressure(body, rising, falling)
    drag = _drag(body, edge, (arm.vx, arm.vy))
    weight = jnp.where(y < body.known["surface_level"], 0.0, body.known["gravity"])

    # Forces of each segment on its nearer and its farther pair of nodes.
    near_x = long * edge[0] + _pair(press * rising[1], -press * falling[1])
    near_y = long * edge[1] + _pair(-press * rising[0], press * falling[0])
    pinch_x, pinch_y = wide * chord[0], wide * chord[1]
    far_x = _pair(press * falling[1] + pinch_x, -press * rising[1] - pinch_x) - long * edge[0]
    far_y = _pair(-press * falling[0] + pinch_y, press * rising[0] - pinch_y) - long * edge[1]

    base_force = near_y[:, :1] - body.base_mass * weight[:, :1]
    torque = (base_x * base_force - base_y * near_x[:, :1])[:, 0]
    return Arm(
        theta=arm.omega,
        omega=(pull.torque + torque[0] + torque[1]) / body.inertia[0, 0],
        x=arm.vx,
        y=arm.vy,
        vx=(far_x + _following(near_x) + drag[0]) / body.mass,
        vy=(far_y + _following(near_y) + drag[1]) / body.mass - weight[:, 1:],
    )


def _tension(body: Body, pull: Part, rest: Part, gain: Part, edge: Pair, rate: Pair) -> Part:
    """Force of each muscle over its present length, positive where it pulls.

    Args:
        body: The arm's constants.
        pull: Stiffness under the action, with the gain in it.
        rest: Length at rest.
        gain: Factor of the damping.
        edge: From one end to the other.
        rate: How that changes.
    """
    square = edge[0] ** 2 + edge[1] ** 2
    length = jnp.sqrt(square)
    stretch = length / rest - body.known["muscle_min_length"]
    spring = jnp.where(stretch > 0, pull * stretch, 0.0)
    # Damping acts on slack muscles too, and may push.
    damping = body.known["muscle_damping"] * gain * (rate[0] * edge[0] + rate[1] * edge[1])
    return (spring * length + damping) / square


def _pressure(body: Body, rising: Pair, falling: Pair) -> Part:
    """Pressure of each compartment, the root of its excess area: positive draws the corners in."""
    area = signed_area(rising, falling)
    excess = body.known["pressure"] * (jnp.abs(area) - body.area)
    return jnp.sign(area) * _signed_root(excess)


def _drag(body: Body, edge: Pair, v: Pair) -> Pair:
    """Drag on the free nodes, quadratic in the velocities along and across the edge before each."""
    square = edge[0] ** 2 + edge[1] ** 2
    scale = -1.0 / (square * jnp.sqrt(square))
    tangential, normal = v[0] * edge[0] + v[1] * edge[1], v[1] * edge[0] - v[0] * edge[1]
    tangential = body.known["friction_tangential"] * jnp.abs(tangential) * tangential * scale
    normal = body.known["friction_perpendicular"] * jnp.abs(normal) * normal * scale
    return tangential * edge[0] - normal * edge[1], tangential * edge[1] + normal * edge[0]


def _pair(upper: Part, lower: Part) -> Part:
    return jnp.concatenate([upper, lower], axis=0)


def _following(near: Part) -> Part:
    """What the segment after each free node does to it: nothing at the tip."""
    return jnp.pad(near[:, 1:], [(0, 0), (0, 1)] + [(0, 0)] * (near.ndim - 2))


@jax.custom_jvp
def _signed_root(q: Part) -> Part:
    """sign(q) sqrt(|q|), with a finite slope also where an arm at rest is, at 0."""
    return jnp.sign(q) * jnp.sqrt(jnp.abs(q))


@_signed_root.defjvp
def _(primals: tuple[Part], tangents: tuple[Part]) -> tuple[Part, Part]:
    (q,), (tangent,) = primals, tangents
    return _signed_root(q), tangent * 0.5 / jnp.sqrt(jnp.maximum(jnp.abs(q), STEEPEST))
