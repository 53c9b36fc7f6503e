"""What is static about a world: its sizes, its boxes, and which ends of a box are meant."""

import dataclasses
import math
from typing import NamedTuple

# From here on an end is none (docs/decisions/0034): single precision holds no sum of such squares.
NO_BOUND = 1e15
# The largest of half precision and of 32 bits, and what single precision makes of the latter.
LARGEST = (65504.0, 2.0**31 - 1, 2.0**31, 2.0**32 - 1, 2.0**32)


def meant(end: float) -> float:
    """An end of a box; infinite where nobody can mean it, such as the largest number there is."""
    absurd = abs(end) >= NO_BOUND or abs(end) in LARGEST
    return math.copysign(math.inf, end) if absurd else float(end)


class Bounds(NamedTuple):
    """The box of legal actions, action units (-inf, inf: unbounded); its length is m."""

    low: tuple[float, ...]
    high: tuple[float, ...]

    @classmethod
    def unbounded(cls, size: int) -> "Bounds":
        """Every action is legal."""
        return cls((-math.inf,) * size, (math.inf,) * size)

    @property
    def meant(self) -> "Bounds":
        """The same box, infinite where an end cannot be meant."""
        return Bounds(*(tuple(map(meant, ends)) for ends in self))

    @property
    def scaled(self) -> "Bounds":
        """The same box in its own units: [-1, 1] where a component has both bounds."""
        return Bounds(*zip(*((-1.0, 1.0) if f else end for f, *end in self._components())))

    @property
    def centre(self) -> tuple[float, ...]:
        """What 0 means in those units; 0 where a bound is missing."""
        return tuple((low + high) / 2 if fine else 0.0 for fine, low, high in self._components())

    @property
    def half_range(self) -> tuple[float, ...]:
        """What 1 means in those units, from the centre; 1 where a bound is missing."""
        return tuple((high - low) / 2 if fine else 1.0 for fine, low, high in self._components())

    def _components(self) -> list[tuple[bool, float, float]]:
        pairs = zip(*self.meant, strict=True)
        return [(math.isfinite(high - low), low, high) for low, high in pairs]


@dataclasses.dataclass(frozen=True)
class EnvironmentSpec:
    """What is static about an environment: sizes, bounds, time limit, discount.

    A bound that nobody can mean, of 1e15 or more, counts as none and becomes infinite
    (docs/decisions/0034).

    Attributes:
        name: Registry name.
        observation_size: Length of the observation vector.
        action_size: m, the length of the action vector.
        action_low: Lower bound of each action component, in action units (-inf: unbounded).
        action_high: Upper bound of each action component.
        time_limit: Steps after which an episode is cut; 1 for a bandit.
        discount: gamma, as used in the paper for this environment.
        observation_low: Lower bound of each observation component; empty: unbounded or unknown.
        observation_high: Upper bound of each observation component.
    """

    name: str
    observation_size: int
    action_size: int
    action_low: tuple[float, ...]
    action_high: tuple[float, ...]
    time_limit: int
    discount: float
    observation_low: tuple[float, ...] = ()
    observation_high: tuple[float, ...] = ()

    def __post_init__(self):
        for name in ("action_low", "action_high", "observation_low", "observation_high"):
            object.__setattr__(self, name, tuple(map(meant, getattr(self, name))))

    @property
    def bounds(self) -> Bounds:
        """The legal actions."""
        return Bounds(self.action_low, self.action_high)
