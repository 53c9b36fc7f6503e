"""The octopus arm: where it is, and what its equations of motion need of the parameters.

Arrays have the axes (sides, nodes or segments, batch axes). Side 0 is the upper (dorsal) one; nodes
and segments count from the base; what is one for both sides, or for the whole arm, has length 1
there. Segment k has the corners U_k, U_{k+1}, L_{k+1}, L_k. Batch axes come last, so that the lanes
of a vector processor hold neighbouring arms.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from detpg.environments.octopus_arm.parameters import OctopusParameters

Part = Float[Array, "_ _ *#batch"]
Pair = tuple[Part, Part]


class Arm(eqx.Module):
    """Where the arm is and how it moves, 2 + 8S numbers.

    Attributes:
        theta: Angle of the upper base node about the base's centre, rad, counter-clockwise.
        omega: Its rate.
        x: Positions of the free nodes.
        y: The same.
        vx: Velocities of the free nodes.
        vy: The same.
    """

    theta: Float[Array, "*batch"]
    omega: Float[Array, "*batch"]
    x: Float[Array, "2 segments *batch"]
    y: Float[Array, "2 segments *batch"]
    vx: Float[Array, "2 segments *batch"]
    vy: Float[Array, "2 segments *batch"]


class Body(eqx.Module):
    """The parameters as the equations use them.

    Attributes:
        length: Lengths of the longitudinal muscles at rest.
        width: Lengths of the transversal muscles at rest.
        strength: Gain of the longitudinal muscles, width^2 / (2 length).
        area: Areas of the compartments at rest.
        mass: Masses of the free nodes.
        base_mass: Mass of each base node.
        base_x: Centre of the base.
        base_y: The same.
        radius: Half the distance of the base nodes.
        inertia: Moment of inertia of the base.
        known: The material constants, by their names in the parameters.
    """

    length: Part
    width: Part
    strength: Part
    area: Part
    mass: Part
    base_mass: Part
    base_x: Part
    base_y: Part
    radius: Part
    inertia: Part
    known: dict[str, Part]


def body_of(parameters: OctopusParameters) -> Body:
    """Lengths, areas and masses of the arm at rest."""
    x, y = _sides(parameters)
    length = jnp.hypot(along(x), along(y))
    width = jnp.hypot(across(x), across(y))
    radius, mass = width[:, :1] / 2, parameters.mass[None]
    shape = {"upper", "lower", "mass"}
    return Body(
        length=length,
        width=width[:, 1:],
        strength=width[:, 1:] ** 2 / (2 * length),
        area=jnp.abs(signed_area(*diagonals(x, y))),
        mass=mass[:, 1:],
        base_mass=mass[:, :1],
        base_x=jnp.mean(x[:, :1], axis=0, keepdims=True),
        base_y=jnp.mean(y[:, :1], axis=0, keepdims=True),
        radius=radius,
        inertia=2 * mass[:, :1] * radius**2,
        known={k: v[None, None] for k, v in vars(parameters).items() if k not in shape},
    )


def at_rest(parameters: OctopusParameters) -> Arm:
    """The arm in its shape at rest, without motion."""
    x, y = _sides(parameters)
    theta = jnp.arctan2(y[0, 0] - y[1, 0], x[0, 0] - x[1, 0])
    still = jnp.zeros_like(x[:, 1:])
    return Arm(theta, jnp.zeros_like(theta), x[:, 1:], y[:, 1:], still, still)


def base(body: Body, arm: Arm) -> Pair:
    """Coordinates of the base nodes, as seen from the base's centre."""
    theta, lever = arm.theta[None, None], side(arm.x) * body.radius
    return lever * jnp.cos(theta), lever * jnp.sin(theta)


def nodes(body: Body, arm: Arm) -> Pair:
    """Coordinates x and y of all nodes, the base's first."""
    base_x, base_y = base(body, arm)
    x = jnp.concatenate([body.base_x + base_x, arm.x], axis=1)
    return x, jnp.concatenate([body.base_y + base_y, arm.y], axis=1)


def side(like: Part) -> Part:
    """+1 for the upper side, -1 for the lower one."""
    return jnp.asarray([1.0, -1.0], dtype=like.dtype).reshape(2, *(1,) * (like.ndim - 1))


def along(node: Part) -> Part:
    """From each node to the next of its side."""
    return node[:, 1:] - node[:, :-1]


def across(node: Part) -> Part:
    """From the upper to the lower node of each pair."""
    return node[1:] - node[:1]


def diagonals(x: Part, y: Part) -> tuple[Pair, Pair]:
    """From L_k to U_{k+1}, and from U_k to L_{k+1}."""
    rising = x[:1, 1:] - x[1:, :-1], y[:1, 1:] - y[1:, :-1]
    return rising, (x[1:, 1:] - x[:1, :-1], y[1:, 1:] - y[:1, :-1])


def signed_area(rising: Pair, falling: Pair) -> Part:
    """Area of each compartment from its diagonals, positive at rest."""
    return (falling[0] * rising[1] - falling[1] * rising[0]) / 2


def _sides(parameters: OctopusParameters) -> Pair:
    x = jnp.stack([parameters.upper[:, 0], parameters.lower[:, 0]])
    return x, jnp.stack([parameters.upper[:, 1], parameters.lower[:, 1]])
