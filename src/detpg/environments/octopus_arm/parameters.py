"""The octopus arm's constants: two published sets, or one's own."""

import dataclasses
from collections.abc import Callable

import equinox as eqx
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from detpg.types import Number, strong


class OctopusParameters(eqx.Module):
    """Material constants, and the shape at rest, of an arm of S segments and S + 1 pairs of nodes.

    A length of 1 is about that of a segment; times and masses are in the simulator's own units.
    `dataclasses.replace(rl_library(), pressure=20.0)` is a set of one's own.

    Attributes:
        upper: Nodes of the upper (dorsal) side at rest, x and y, base first.
        lower: Nodes of the lower (ventral) side at rest.
        mass: Mass of each node; both of a pair weigh the same.
        friction_tangential: Drag coefficient along the edge.
        muscle_passive: Stiffness of a muscle that is not activated.
        muscle_min_length: Length at which a muscle pulls no more, as a part of its length at rest.
        muscle_damping: Damping of a muscle.
        friction_perpendicular: Drag coefficient across the edge.
        muscle_active: Stiffness that full activation adds.
        pressure: How hard a compartment resists a change of its area.
        gravity: Acceleration towards -y, felt above the surface only.
        surface_level: Height y of the water's surface.
        torque: Torque of a full base action.
    """

    upper: Float[Array, "pairs 2"] = eqx.field(converter=strong)
    lower: Float[Array, "pairs 2"] = eqx.field(converter=strong)
    mass: Float[Array, "pairs"] = eqx.field(converter=strong)
    friction_tangential: Number = eqx.field(converter=strong)
    muscle_passive: Number = eqx.field(converter=strong)
    muscle_min_length: Number = eqx.field(converter=strong)
    muscle_damping: Number = eqx.field(converter=strong)
    friction_perpendicular: Number = eqx.field(converter=strong, default=1.0)
    muscle_active: Number = eqx.field(converter=strong, default=0.1)
    pressure: Number = eqx.field(converter=strong, default=10.0)
    gravity: Number = eqx.field(converter=strong, default=0.01)
    surface_level: Number = eqx.field(converter=strong, default=5.0)
    torque: Number = eqx.field(converter=strong, default=0.025)

    def __check_init__(self):
        """Refuses sizes that do not fit and numbers that no arm can have."""
        sizes, pairs = (self.upper.shape, self.lower.shape, self.mass.shape), self.mass.size
        if pairs < 2 or sizes != ((pairs, 2), (pairs, 2), (pairs,)):
            raise ValueError(
                f"upper {sizes[0]}, lower {sizes[1]} and mass {sizes[2]} do not fit: an arm of S "
                "segments needs (S + 1, 2), (S + 1, 2) and (S + 1,), with S at least 1."
            )
        values = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        for name, value in values.items():
            _check_number(name, value)
        if not any(isinstance(value, Tracer) for value in (self.upper, self.lower)):
            _check_shape(np.asarray(self.upper), np.asarray(self.lower))

    @property
    def num_segments(self) -> int:
        return self.mass.shape[-1] - 1

    def first(self, num_segments: int) -> "OctopusParameters":
        """The arm cut after its first segments.

        Raises:
            ValueError: No number of segments, less than one, or more than there are.
        """
        whole = isinstance(num_segments, int | np.integer)
        if not (whole and 1 <= num_segments <= self.num_segments):
            raise ValueError(
                f"num_segments = {num_segments} is not usable: give 1 to {self.num_segments} with "
                "these parameters, or OctopusParameters of more pairs of nodes."
            )
        pairs = num_segments + 1
        return dataclasses.replace(
            self, upper=self.upper[:pairs], lower=self.lower[:pairs], mass=self.mass[:pairs]
        )


OF_ANY_SIGN = {"upper", "lower", "gravity", "surface_level"}


def _check_number(name: str, value: Array) -> None:
    if isinstance(value, Tracer):
        return
    numbers = np.asarray(value)
    fine = np.isfinite(numbers)
    if name not in OF_ANY_SIGN:
        fine &= numbers > 0 if name == "mass" else numbers >= 0
    if not fine.all():
        raise ValueError(f"{name} holds {numbers[~fine].flat[0]:g}, which no arm can have.")


def _check_shape(upper: np.ndarray, lower: np.ndarray) -> None:
    """No edge without a length, no compartment turned inside out."""
    edges = [np.diff(upper, axis=0), np.diff(lower, axis=0), upper - lower]
    down, up = lower[1:] - upper[:-1], upper[1:] - lower[:-1]
    areas = (up[:, 1] * down[:, 0] - up[:, 0] * down[:, 1]) / 2
    if min(np.hypot(*edge.T).min() for edge in edges) == 0 or areas.min() <= 0:
        raise ValueError(
            "Two neighbouring nodes coincide or a compartment is turned inside out at rest: give "
            "upper nodes on the left of an arm that is seen from its base, lower ones on the right."
        )


def rl_library() -> OctopusParameters:
    """Set A: what is built into RL-Library and the RL-Competitions of 2008 and 2009."""
    x = [0.0019745749999999923, 0.899289575, 1.7966045750000001, 2.693919575, 3.5912345749999997]
    x += [4.488549575, 5.385864575, 6.283179575, 7.180494575, 8.077809575, 8.975124575]
    half_width = [0.4302831250000001, 0.42410127500000017, 0.41791942500000023, 0.4117375750000003]
    half_width += [0.4055557249999999, 0.399373875, 0.39319202500000006, 0.3870101750000001]
    half_width += [0.3808283250000002, 0.37464647500000026, 0.3684646249999999]
    mass = [0.675233311763865, 0.675233311763865, 0.6689518869502691, 0.6627037820540759]
    mass += [0.656489948437103, 0.6503113685034645, 0.6441690566663911, 0.6380640603292209]
    mass += [0.631997460878506, 0.625970374686908, 0.6199839541231545]
    return OctopusParameters(
        upper=np.stack([x, half_width], axis=1),
        lower=np.stack([x, np.negative(half_width)], axis=1),
        mass=mass,
        friction_tangential=0.4,
        muscle_passive=0.04,
        muscle_min_length=0.1,
        muscle_damping=1.0,
    )


def benchmark_2006() -> OctopusParameters:
    """Set B: settings of the ICML 2006 benchmark; the base torque, absent there, is that of A."""
    mass = [1.0, 0.9900990099, 0.9803921569, 0.9708737864, 0.9615384615, 0.9523809524]
    mass += [0.8433962264, 0.8345794393, 0.8259259259, 0.8174311927, 0.7090909091]
    mass += [0.7009009009, 0.7928571429]
    x = np.arange(len(mass))
    return OctopusParameters(
        upper=np.stack([x, np.ones_like(x)], axis=1),
        lower=np.stack([x, np.zeros_like(x)], axis=1),
        mass=mass,
        friction_tangential=0.2,
        muscle_passive=0.05,
        muscle_min_length=0.4,
        muscle_damping=0.3,
    )


PAPERS_SEGMENTS = 6
PARAMETERS: dict[str, Callable[[], OctopusParameters]] = {"A": rl_library, "B": benchmark_2006}


def choose(parameters: str | OctopusParameters, num_segments: int | None) -> OctopusParameters:
    """Parameters by name or as they are, cut to a number of segments.

    Raises:
        ValueError: An unknown name, or segments that the parameters do not have.
    """
    if isinstance(parameters, OctopusParameters):
        return parameters if num_segments is None else parameters.first(num_segments)
    if parameters not in PARAMETERS:
        raise ValueError(
            f"parameters {parameters!r} are unknown: choose one of {', '.join(PARAMETERS)}, or "
            "give OctopusParameters."
        )
    return PARAMETERS[parameters]().first(PAPERS_SEGMENTS if num_segments is None else num_segments)


def checked_episode(time_limit: int, discount: float) -> tuple[int, float]:
    """Both as they are.

    Raises:
        ValueError: An episode without a step, or a discount that is none.
    """
    if time_limit < 1 or not 0 <= discount <= 1:
        raise ValueError(
            f"time_limit = {time_limit} and discount = {discount:g} are not usable: give at least "
            "one step and a number from 0 to 1."
        )
    return time_limit, discount
