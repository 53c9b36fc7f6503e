"""What Section 5.3 and its Figure 3 show, judged on our runs."""

import numpy as np

from detpg.evaluation.intervals import bootstrap_means, interval
from detpg.experiments.claims import Claim, Verdict
from detpg.experiments.published import published_curve
from detpg.experiments.study import Condition, Results

RULE = "mean"
SOLVED = 100.0  # steps to the target: below, a run counts as converged
LAST = 4  # evaluations in the last 60,000 steps
NUM_PUBLISHED = 10
UNJUDGED: Verdict = "no number to compare"

VERDICTS = (
    "A run has *converged* if the mean policy hits the target in fewer than 100 steps at the end "
    "and at each of the four evaluations in the last 60,000 steps of learning. A claim with a "
    "published number is *reproduced* if the 95% interval of ours and that of the ten published "
    "runs overlap, and *not reproduced* otherwise, whether ours is better or worse; that ours is "
    "at or below the published mean at every evaluation, if the greatest ratio of the two means "
    "is at most 1, and the interval does not decide. Intervals of "
    "means are percentile bootstraps over runs, those of fractions Wilson's. The setting was "
    "chosen on sweep seeds by the mean number of steps to the target over the whole run; all "
    "numbers here are from fresh seeds. The return of Figure 3 has a scale that the paper does not "
    "give, so it is drawn but not judged."
)


def published_runs() -> np.ndarray:
    """Steps to the target of the ten published runs at our evaluations, shape (10, 20)."""
    at = np.arange(15_000, 300_001, 15_000)
    curves = (published_curve("figure3", "steps", f"run {i + 1}") for i in range(NUM_PUBLISHED))
    # One point of some runs is hidden behind others in the drawing: it is read off the line.
    return np.stack([np.interp(at, x, y) for x, y in curves])


def judge(results: Results) -> list[Claim]:
    """The claims for the chosen point of every learner."""
    theirs = published_runs()[:, : len(results.study.conditions[0].times)]
    claims: list[Claim] = []
    for condition in results.study.conditions:
        for arm in results.points:
            claims += _claims(results, condition, arm, theirs)
    return claims


def converged(steps: np.ndarray) -> np.ndarray:
    """Whether each run ends below 100 steps and stays there, shape (runs,)."""
    return np.all(steps[:, -LAST:] < SOLVED, axis=1)


def first_solved(steps: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Training steps of the first evaluation below 100 steps; NaN where there is none."""
    below = steps < SOLVED
    return np.where(below.any(axis=1), times[below.argmax(axis=1)], np.nan)


def relapsed(steps: np.ndarray) -> np.ndarray:
    """Whether a run is at 100 steps or more again after it was below, shape (runs,)."""
    been = np.logical_or.accumulate(steps < SOLVED, axis=1)
    return np.any(been & (steps >= SOLVED), axis=1)


def _claims(results: Results, condition: Condition, arm: str, theirs: np.ndarray) -> list[Claim]:
    steps = np.nan_to_num(results.runs(condition, arm, RULE), nan=np.inf).astype(np.float64)
    times, seed = np.asarray(condition.times, dtype=np.float64), results.seed
    lost = int(np.sum(~np.isfinite(steps).all(axis=1)))
    parts = (
        ("converged", "fraction of runs that converge", _fraction, converged),
        (
            "relapsed",
            "fraction of runs that are at 100 steps again after less",
            _fraction,
            relapsed,
        ),
        ("end", "steps to the target at the end, mean", _mean, lambda x: x[:, -1]),
        (
            "first-below-100",
            "training steps until first below 100, mean over the runs that get there",
            _mean,
            lambda x: first_solved(x, times),
        ),
    )
    claims = []
    for name, words, summarise, measure in parts:
        ours, published = measure(steps), measure(theirs)
        value, bounds = summarise(ours, seed)
        expected, expected_bounds = summarise(published, seed)
        verdict: Verdict = "not reproduced"
        if _overlap(bounds, expected_bounds):
            verdict = "reproduced"
        path, statement = f"{name}/{arm}".lower().replace(" ", "-"), f"{arm}: {words}"
        claims.append(
            Claim(path, statement, _known(expected), value, bounds, len(steps), lost, arm, verdict)
        )
    return [*claims, _never_slower(steps, theirs, arm, seed)]


def _never_slower(steps: np.ndarray, theirs: np.ndarray, arm: str, seed: int) -> Claim:
    """Ours over the published mean, at the evaluation where ours compares worst."""
    published = theirs.mean(axis=0)
    capped = np.minimum(steps, 300.0)
    ratios = capped.mean(axis=0) / published
    resampled = (bootstrap_means(capped.T, seed) / published[:, None]).max(axis=0)
    worst, bounds = float(ratios.max()), interval(resampled)
    verdict: Verdict = "reproduced" if worst <= 1 else "not reproduced"
    statement = (
        f"{arm}: mean steps to the target at or below the published mean at every evaluation: "
        "greatest ratio of the two"
    )
    path = f"never-slower/{arm}".lower().replace(" ", "-")
    return Claim(path, statement, 1.0, worst, bounds, len(steps), 0, arm, verdict)


def _mean(values: np.ndarray, seed: int) -> tuple[float, tuple[float, float]]:
    kept = values[np.isfinite(values)]
    if kept.size == 0:
        return np.nan, (np.nan, np.nan)
    return float(kept.mean()), interval(bootstrap_means(kept[None], seed)[0])


def _fraction(values: np.ndarray, seed: int) -> tuple[float, tuple[float, float]]:
    from scipy.stats import binomtest  # slow to import, and workers judge nothing

    bounds = binomtest(int(values.sum()), values.size).proportion_ci(method="wilson")
    return float(values.mean()), (float(bounds.low), float(bounds.high))


def _known(published: float) -> float | None:
    """None where a study that stops early leaves nothing to compare with."""
    return published if np.isfinite(published) else None


def _overlap(ours: tuple[float, float], theirs: tuple[float, float]) -> bool:
    return ours[0] <= theirs[1] and theirs[0] <= ours[1]
