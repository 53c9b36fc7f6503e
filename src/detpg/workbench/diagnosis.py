"""Words instead of a bad curve: what is wrong with a run, and what to try."""

from typing import Any, NamedTuple

import numpy as np

from detpg.types import Bounds
from detpg.world_error import WorldError
from detpg.wrappers.metered import QUANTITIES

SATURATED = 0.9  # share of mean-action components on a bound
OVERESTIMATED = 1.0  # mean overestimate, in units of the returns' size
LEAST_CHANGE = 1e-7  # of the policy's parameters over an interval, relative
LEAST_NOISE = 1e-3  # root mean square deviation from the mean action, half ranges
NUM_ROWS = 3  # that have to agree


class DivergedError(Exception):
    """Every learner of a run is non-finite; the message is one sentence for the user."""


class Fault(NamedTuple):
    """Why a learner is lost.

    Attributes:
        words: What became non-finite first, and when.
        by_world: Whether that came from the world.
    """

    words: str
    by_world: bool


def faults(meter: Any, finite: np.ndarray) -> dict[int, Fault]:
    """Seed -> what became non-finite and when, of learners that are no longer finite.

    Args:
        meter: `wrappers.Meter`, seeds first.
        finite: Whether all parameters of each learner are.
    """
    found: dict[int, Fault] = {}
    for seed, fault in enumerate(np.asarray(meter.fault)):
        if fault:
            step = int(np.asarray(meter.fault_step)[seed]) + 1
            component, kind = divmod(int(fault), len(QUANTITIES))
            found[seed] = _fault(QUANTITIES[kind], component, step)
        elif not finite[seed]:
            step = int(np.asarray(meter.age)[seed])
            found[seed] = Fault(f"a parameter is not finite at step {step}", by_world=False)
    return found


def _fault(quantity: str, component: int, step: int) -> Fault:
    found = f"component {component} of the observation"
    by_world = {
        "observation": f"{found}, before step {step:,}",
        "next observation": f"{found}, at step {step:,}",
        "reward": f"the reward of step {step:,}",
    }
    if quantity in by_world:
        words = f"the world returned what is not finite, as {by_world[quantity]}"
        return Fault(words, by_world=True)
    return Fault(f"the {quantity} of step {step:,} is not finite", by_world=False)


def ended(lost: dict[int, Fault], bounds: Bounds, kept: str = "") -> Exception:
    """What ends a run whose learners are all lost.

    Args:
        lost: Why, of each of them.
        bounds: Of the actions: within bounds a world is never driven to where numbers end.
        kept: What is left of the run, in words.
    """
    found = [lost[seed] for seed in sorted(lost)]
    # One that was lost by itself says more: the others may have been driven there likewise.
    fault = min(found, key=lambda fault: fault.by_world)
    bounded = bool(np.all(np.isfinite(bounds)))
    if fault.by_world and bounded:
        mend = "Let it return finite numbers, or terminate where it breaks down."
        return WorldError("The run is lost", f"{fault.words}. {mend}")
    where = "; ".join(filter(None, (fault.words, kept)))
    mend = "Lower the step sizes, or normalise observations and rewards."
    if fault.by_world:
        mend = (
            "Its actions have no bounds: give it some, or lower the step sizes; if they were "
            "small, mend the world."
        )
    return DivergedError(f"The run diverged: {where}. {mend}")


def warnings(rows: list[dict[str, Any]]) -> dict[str, str]:
    """Kind -> a warning in words, from the last rows of one seed's metrics.

    Args:
        rows: In order of steps.
    """
    found = {}
    last = rows[-NUM_ROWS:]
    if len(last) < NUM_ROWS:
        return found
    if (share := _least(last, "train/saturated")) > SATURATED:
        found["saturated"] = (
            f"the mean action lies on a bound in {share:.0%} of its components: lower alpha_theta, "
            "or scale rewards down (--normalise both)."
        )
    if _most(last, "train/exploration") < LEAST_NOISE:
        found["exploration"] = (
            "actions hardly differ from the mean action, so nothing new is tried: raise sigma (dac "
            "has none: it needs random starts and a policy that saturates)."
        )
    changes = [row["train/policy_change"] for row in rows if _known(row, "train/policy_change")]
    still = len(changes) >= NUM_ROWS and max(changes[-NUM_ROWS:]) < LEAST_CHANGE
    if still and "saturated" not in found:  # which explains it, and asks for the opposite
        found["stuck"] = (
            f"the policy changed by less than {LEAST_CHANGE:g} of its size since the last "
            "evaluation: raise alpha_theta, or see whether the critic learns (train/td_error)."
        )
    judged = [row for row in rows if _known(row, "eval/value_bias")][-NUM_ROWS:]
    excess = [row["eval/value_bias"] / max(row["eval/value_scale"], 1e-9) for row in judged]
    if len(excess) == NUM_ROWS and min(excess) > OVERESTIMATED:
        row = judged[-1]
        found["overestimated"] = (
            f"the critic promises {row['eval/value_bias']:.3g} more than episodes return (their "
            f"size is {row['eval/value_scale']:.3g}): lower alpha_w or alpha_v."
        )
    return found


def _known(row: dict[str, Any], name: str) -> bool:
    return row.get(name) is not None and bool(np.isfinite(row[name]))


def _values(rows: list[dict[str, Any]], name: str) -> list[float]:
    return [row[name] for row in rows if _known(row, name)]


def _least(rows: list[dict[str, Any]], name: str) -> float:
    return min(_values(rows, name), default=-np.inf)


def _most(rows: list[dict[str, Any]], name: str) -> float:
    return max(_values(rows, name), default=np.inf)
