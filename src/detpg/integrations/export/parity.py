"""Whether an exported file answers as the training code does."""

import dataclasses
import functools
import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from detpg.integrations.export.parts import (
    deployed,
    parts_of,
    single_precision,
    single_precision_mode,
)
from detpg.types import EnvironmentSpec
from detpg.wrappers import Controller

EPSILON = 2.0**-23  # the spacing of float32 at 1
SCALES = (1e-3, 0.1, 1.0, 10.0, 1e3)
EACH = 48  # random observations of each kind
DRAWS = 8
# Two float32 programs of one function differ by rounding: each product, sum and elementary function
# by some epsilons of its own size, never of the result's alone. What that does to the result is
# measured: each parameter and observation is moved by WOBBLE epsilons up or down, at random, and
# the action may differ by MARGIN times the furthest that it moved (or jumped, where an observation
# lies on the edge of a tile), and by LAST epsilons of its own size for the scaling at the end.
WOBBLE, MARGIN, LAST = 2, 2, 4


@dataclasses.dataclass(frozen=True)
class Parity:
    """How far an exported file is from the training code.

    Attributes:
        difference: The largest difference of an action, in half ranges.
        observation: Where that was.
        excess: The largest difference over what rounding explains there; up to 1 is equal.
        excess_observation: Where that was.
        excess_difference: The difference there, in half ranges.
        num_observations: How many were compared.
    """

    difference: float
    observation: tuple[float, ...]
    excess: float
    excess_observation: tuple[float, ...]
    excess_difference: float
    num_observations: int

    @property
    def equal(self) -> bool:
        """Whether rounding explains every difference."""
        return self.excess <= 1


def parity(
    controller: Controller,
    observation_size: int,
    run: Callable[[np.ndarray], Any],
    spec: EnvironmentSpec | None = None,
) -> Parity:
    """Compares a function with the controller that it was made from.

    Over random observations of several sizes, those the normaliser and the environment expect, and
    extreme ones: 0, 1e6, denormal and infinite numbers, NaN. An action that is NaN must be NaN on
    both sides. Some observations are also asked alone, not in a batch.

    Args:
        controller: The training code, which is run in float32.
        observation_size: d.
        run: From observations [N, d] to actions [N, m], for any N.
        spec: Of the environment, for the bounds of its observations.
    """
    with np.errstate(all="ignore"), single_precision_mode():
        controller = single_precision(controller)
        seen = observations(controller, observation_size, spec)
        wanted, moved = _answers(controller, seen)
        found = np.asarray(run(seen))
        alone = slice(None, None, EACH // 2)
        asked = np.concatenate([np.asarray(run(row[None])) for row in seen[alone]])
    if found.shape != wanted.shape:
        raise ValueError(
            f"The actions of {len(seen)} observations have shape {found.shape}, not {wanted.shape}."
        )
    seen, wanted, moved = (np.concatenate([x, x[alone]]) for x in (seen, wanted, moved))
    return _compared(controller, seen, wanted, moved, np.concatenate([found, asked]))


def observations(
    controller: Controller, size: int, spec: EnvironmentSpec | None
) -> Float[np.ndarray, "points obs"]:
    """Random and extreme observations, the same every time."""
    generator = np.random.default_rng(0)
    normal = functools.partial(generator.standard_normal, (EACH, size))
    rows = [scale * normal() for scale in SCALES]
    normaliser = parts_of(controller).normaliser
    if normaliser is not None:
        mean, deviation = np.asarray(normaliser.mean), np.asarray(normaliser.deviation)
        rows += [mean + scale * deviation * normal() for scale in (1, 3)]
    if spec is not None and all(map(math.isfinite, spec.observation_low + spec.observation_high)):
        low, high = np.asarray(spec.observation_low), np.asarray(spec.observation_high)
        if low.size == size:
            inside = low + (high - low) * generator.uniform(size=(EACH, size))
            rows += [low[None], high[None], (low + high)[None] / 2, inside]
    signs = np.where(np.arange(size) % 2, -1.0, 1.0)
    first = np.arange(size) == 0
    for extreme in (1e6, -1e6, 1e6 * signs, 1e-40, -1e-40, np.inf, -np.inf, np.nan):
        rows += [np.broadcast_to(extreme, (1, size)), np.where(first, extreme, 0.0)[None]]
    return np.concatenate([np.zeros((1, size)), *rows]).astype(np.float32)


@jax.jit
def _actions(
    controller: Controller, seen: Float[Array, "points obs"]
) -> Float[Array, "points act"]:
    return jax.vmap(deployed(controller))(seen)


def _answers(
    controller: Controller, seen: Float[np.ndarray, "points obs"]
) -> tuple[Float[np.ndarray, "points act"], Float[np.ndarray, "points act"]]:
    """The actions, and the furthest that each moves when all numbers wobble by rounding."""
    generator, given = np.random.default_rng(1), (controller, seen)
    wanted, moved = np.asarray(_actions(*given)), []
    for _ in range(DRAWS):
        near = jax.tree.map(functools.partial(_wobbled, generator), given)
        found = np.asarray(_actions(*near))
        change = np.where(found == wanted, 0, np.abs(found - wanted))
        moved.append(np.where(np.isnan(change), np.inf, change))
    return wanted, np.max(moved, 0)


def _wobbled(generator: np.random.Generator, leaf: Any) -> Any:
    if not jnp.issubdtype(leaf.dtype, jnp.floating):
        return leaf
    signs = generator.choice(np.asarray([-1, 1], np.float32), leaf.shape)
    return jnp.asarray(np.asarray(leaf) * (1 + np.float32(WOBBLE * EPSILON) * signs))


def _compared(
    controller: Controller,
    seen: np.ndarray,
    wanted: np.ndarray,
    moved: np.ndarray,
    found: np.ndarray,
) -> Parity:
    half = np.asarray(controller.bounds.half_range)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        apart = np.abs(found.astype(float) - wanted) / half
        same = (found == wanted) | (np.isnan(found) & np.isnan(wanted))
        apart = np.where(same, 0.0, np.where(np.isnan(apart), np.inf, apart))
        own = LAST * EPSILON * (1 + np.abs(wanted.astype(float)) / half)
        allowed = own + MARGIN * moved / half
        # What is infinite or NaN on one side alone is explained by nothing.
        both = np.isfinite(found) & np.isfinite(wanted)
        excess = np.where(same, 0.0, np.where(both, apart / allowed, np.inf))
    worst, most = int(np.argmax(apart.max(1))), int(np.argmax(excess.max(1)))
    return Parity(
        difference=float(apart[worst].max()),
        observation=tuple(map(float, seen[worst])),
        excess=float(excess[most].max()),
        excess_observation=tuple(map(float, seen[most])),
        excess_difference=float(apart[most].max()),
        num_observations=len(seen),
    )
