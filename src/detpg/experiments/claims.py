"""A claim of the paper beside our measurement, and the rule that judges it."""

import dataclasses
import math
from typing import Any, Literal

import numpy as np

from detpg.evaluation.intervals import bootstrap_means, interval

Verdict = Literal["reproduced", "not reproduced", "inconclusive"]
WITHIN = 3.0


@dataclasses.dataclass(frozen=True)
class Claim:
    """One claim, judged.

    Attributes:
        id: Stable name, slash-separated.
        statement: The claim in our words.
        published: The paper's number; None where it gives none.
        measured: Ours; infinite where a run diverged.
        interval: 95% interval of ours over runs.
        num_runs: Independent runs behind each mean.
        reading: Which reading of the paper's text was run.
        verdict: By the rule of `within_factor` or `above_one`.
    """

    id: str
    statement: str
    published: float | None
    measured: float
    interval: tuple[float, float]
    num_runs: int
    reading: str
    verdict: Verdict

    def as_json(self) -> dict[str, Any]:
        """JSON types; a number that is not finite becomes null."""
        record = dataclasses.asdict(self)
        record["measured"] = _finite_or_none(self.measured)
        record["interval"] = [_finite_or_none(bound) for bound in self.interval]
        return record


def _finite_or_none(number: float) -> float | None:
    return number if math.isfinite(number) else None


def within_factor(published: float, bounds: tuple[float, float]) -> Verdict:
    """Reproduced if the whole interval lies within a factor 3 of the published number."""
    low, high = bounds
    if not (math.isfinite(low) and math.isfinite(high)):
        return "inconclusive"
    if published / WITHIN <= low and high <= published * WITHIN:
        return "reproduced"
    if high < published / WITHIN or low > published * WITHIN:
        return "not reproduced"
    return "inconclusive"


def above_one(bounds: tuple[float, float]) -> Verdict:
    """Reproduced if the whole interval of a ratio lies above 1, not so if it lies below."""
    low, high = bounds
    if math.isnan(low) or math.isnan(high):
        return "inconclusive"
    return "reproduced" if low > 1 else "not reproduced" if high < 1 else "inconclusive"


@dataclasses.dataclass(frozen=True)
class Ratio:
    """A ratio of mean costs over runs on the same seeds.

    Attributes:
        value: Ratio of the means.
        resampled: The same of resampled runs, shape (resamples,).
    """

    value: float
    resampled: np.ndarray

    @property
    def interval(self) -> tuple[float, float]:
        return interval(self.resampled)


def ratio_of_means(numerator: np.ndarray, denominator: np.ndarray, seed: int) -> Ratio:
    """Mean of one over mean of the other, resampled in pairs.

    Args:
        numerator: Costs, one for each run.
        denominator: Costs of the runs on the same seeds.
        seed: Of the resampling.
    """
    both = np.stack([numerator, denominator]).astype(np.float64)
    above, below = bootstrap_means(both, seed)
    with np.errstate(all="ignore"):
        means = np.where(np.isfinite(both), both, np.inf).mean(axis=1)
        return Ratio(value=float(means[0] / means[1]), resampled=above / below)
