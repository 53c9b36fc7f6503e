"""A claim of the paper beside our measurement, and the rule that judges it."""

import dataclasses
import math
from typing import Any, Literal

import numpy as np

from detpg.evaluation.intervals import NUM_RESAMPLES, bootstrap_means, interval

Verdict = Literal["reproduced", "not reproduced", "inconclusive", "no number to compare"]
WITHIN = 3.0
MAX_LOST = 0.05


@dataclasses.dataclass(frozen=True)
class Claim:
    """One claim, judged.

    Attributes:
        id: Stable name, slash-separated.
        statement: The claim in our words.
        published: The paper's number; None where it gives none.
        measured: Ours, over the runs that stayed finite.
        interval: 95% interval of ours over runs.
        num_runs: Independent runs behind each mean.
        num_diverged: Runs left out because they diverged.
        reading: Which reading of the paper's text was run.
        verdict: By the rule of `within_factor` or `above_one`.
    """

    id: str
    statement: str
    published: float | None
    measured: float
    interval: tuple[float, float]
    num_runs: int
    num_diverged: int
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


def within_factor(published: float, ours: "Ratio") -> Verdict:
    """Reproduced if the whole interval lies within a factor 3 of the published number."""
    low, high = ours.interval
    if not ours.reliable:
        return "inconclusive"
    if published / WITHIN <= low and high <= published * WITHIN:
        return "reproduced"
    if high < published / WITHIN or low > published * WITHIN:
        return "not reproduced"
    return "inconclusive"


def above_one(ours: "Ratio") -> Verdict:
    """Reproduced if the whole interval of a ratio lies above 1, not so if it lies below."""
    low, high = ours.interval
    if not ours.reliable:
        return "inconclusive"
    return "reproduced" if low > 1 else "not reproduced" if high < 1 else "inconclusive"


@dataclasses.dataclass(frozen=True)
class Ratio:
    """A ratio of mean costs over runs on the same seeds.

    Attributes:
        value: Ratio of the means; NaN where no pair of runs stayed finite.
        resampled: The same of resampled runs, shape (resamples,).
        num_runs: Pairs of runs behind it.
        num_diverged: Pairs left out, because a run of theirs diverged.
    """

    value: float
    resampled: np.ndarray
    num_runs: int
    num_diverged: int

    @property
    def interval(self) -> tuple[float, float]:
        return interval(self.resampled)

    @property
    def reliable(self) -> bool:
        """Whether so few runs were left out that the rest speak for all."""
        return self.num_diverged <= MAX_LOST * (self.num_runs + self.num_diverged)


def ratio_of_means(numerator: np.ndarray, denominator: np.ndarray, seed: int) -> Ratio:
    """Mean of one over mean of the other, resampled in pairs.

    A run that diverged has no place in a mean: its pair is left out and counted.

    Args:
        numerator: Costs, one for each run; NaN where the run diverged.
        denominator: Costs of the runs on the same seeds.
        seed: Of the resampling.
    """
    both = np.stack([numerator, denominator]).astype(np.float64)
    kept = both[:, np.all(np.isfinite(both), axis=0)]
    num_runs, num_diverged = kept.shape[1], both.shape[1] - kept.shape[1]
    if num_runs == 0:
        return Ratio(math.nan, np.full(NUM_RESAMPLES, math.nan), 0, num_diverged)
    above, below = bootstrap_means(kept, seed)
    value = float(kept[0].mean() / kept[1].mean())
    return Ratio(value, above / below, num_runs, num_diverged)
