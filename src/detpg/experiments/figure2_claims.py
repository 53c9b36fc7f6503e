"""What Section 5.2 claims, judged on the runs of Figure 2."""

import math

import numpy as np

from detpg.evaluation.intervals import bootstrap_means, interval
from detpg.experiments.claims import MAX_LOST, Claim, Verdict
from detpg.experiments.published import published_curve
from detpg.experiments.selection import lost
from detpg.experiments.study import Condition, Results
from detpg.kernels import TASKS

UNJUDGED: Verdict = "no number to compare"
RULE = "mean"  # points are chosen by the area under the curve
COPDAC = "COPDAC-Q"
SETTINGS = {
    "as printed": {"SAC": "SAC, as printed", "OffPAC-TD": "OffPAC, as printed"},
    "controlled": {"SAC": "SAC, controlled", "OffPAC-TD": "OffPAC, controlled"},
}
# Runs of 30 that reached the goal at the end: a mixture of solved and stuck runs that gives both
# the published mean and its standard error (the pendulum's returns are no such mixture).
PUBLISHED_SOLVED = {
    ("mountain-car", "COPDAC-Q"): 29,
    ("mountain-car", "SAC"): 11,
    ("mountain-car", "OffPAC-TD"): 29,
    ("puddle-world", "COPDAC-Q"): 13,
    ("puddle-world", "SAC"): 7,
    ("puddle-world", "OffPAC-TD"): 0,
}
PUBLISHED_RUNS = 30
PROBABILITY_RESAMPLES = 2000
SAME_TASK = 0.01  # part of a return by which a task may differ and still be taken for the same

VERDICTS = (
    "A claim with a published number is *reproduced* if the 95% interval of ours and that of the "
    "paper's (its number and standard error, or its count of 30 runs) overlap, and *not "
    "reproduced* otherwise, whether ours is better or worse. A comparison of two learners is "
    "*reproduced* if the interval of the probability that a run of COPDAC-Q ends above a run of "
    "the other lies above one half, *not reproduced* if it lies below, *inconclusive* if it holds "
    'one half; for "at least as good" over several comparisons, one that lies below decides. '
    "Intervals of means and probabilities are percentile bootstraps over runs, those of fractions "
    "are Wilson's. A solved run ends with a return above -1,000 (pendulum: 4,000). A run that is "
    "no longer finite counts as not solved and as below every other; it has no place in a mean, "
    f"and with more than {MAX_LOST:.0%} of them the verdict on a mean is inconclusive. Points are "
    "chosen by the mean return over the run (the area under the curve), on sweep seeds; all "
    "numbers here are from fresh seeds. A return before learning identifies a task: it is "
    f"*reproduced* within {SAME_TASK:.0%} or the paper's two standard errors."
)


def judge(results: Results) -> list[Claim]:
    """Every claim on every task, in both settings of the baselines."""
    claims: list[Claim] = []
    for setting, named in SETTINGS.items():
        arms = {series: arm for series, arm in named.items() if arm in results.points}
        if not arms:
            continue
        reading = f"Baselines {setting}"
        members = {COPDAC: COPDAC} | arms
        for condition in results.study.conditions:
            for series, arm in members.items():
                claims += _levels(results, condition, arm, series, reading)
        claims += _comparisons(results, arms, reading)
    extra = [a.name for a in results.study.arms if a.name not in _judged()]
    for arm in (name for name in extra if name in results.points):
        for condition in results.study.conditions:
            claims += _levels(results, condition, arm, None, "Further learners")
    return claims + _untrained(results)


def _judged() -> set[str]:
    return {COPDAC, *(arm for arms in SETTINGS.values() for arm in arms.values())}


def _returns(results: Results, condition: Condition, arm: str) -> np.ndarray:
    """Returns, shape (runs, time); minus infinity throughout a run that is not finite."""
    costs = results.runs(condition, arm, RULE)
    return np.where(lost(costs, None)[:, None], -np.inf, -costs.astype(np.float64))


def _levels(
    results: Results, condition: Condition, arm: str, series: str | None, reading: str
) -> list[Claim]:
    """Final mean, fraction solved and steps to the first solve, of one learner on one task."""
    task, returns = condition.environment, _returns(results, condition, arm)
    name = f"{task}, {arm}"
    path = f"{task}/{arm}/{reading}".lower().replace(",", "").replace(" ", "-")
    return [
        _final_mean(results, returns[:, -1], task, series, (f"final/{path}", name, reading)),
        _fraction_solved(returns[:, -1], task, series, (f"solved/{path}", name, reading)),
        _first_solve(results, returns, condition, (f"first-solve/{path}", name, reading)),
    ]


Words = tuple[str, str, str]


def _final_mean(
    results: Results, final: np.ndarray, task: str, series: str | None, words: Words
) -> Claim:
    path, name, reading = words
    kept = final[np.isfinite(final)]
    ours, bounds = _mean(kept, results.seed)
    published, verdict = None, UNJUDGED
    if series is not None:
        y, low, high = (float(c[-1]) for c in published_curve("figure2", task, series, _ERRORS))
        half = 1.96 * (high - low) / 2
        published, verdict = y, _overlap(bounds, (y - half, y + half))
        if kept.size < (1 - MAX_LOST) * final.size:
            verdict = "inconclusive"
    statement = f"{name}: mean return at the end"
    num_lost = final.size - kept.size
    return Claim(path, statement, published, ours, bounds, kept.size, num_lost, reading, verdict)


_ERRORS = ("y", "low", "high")


def _mean(values: np.ndarray, seed: int) -> tuple[float, tuple[float, float]]:
    """A mean over runs and its interval; NaN where there is no run."""
    if values.size == 0:
        return math.nan, (math.nan, math.nan)
    return float(values.mean()), interval(bootstrap_means(values[None], seed)[0])


def _overlap(ours: tuple[float, float], theirs: tuple[float, float]) -> Verdict:
    return "reproduced" if ours[0] <= theirs[1] and theirs[0] <= ours[1] else "not reproduced"


def _wilson(count: int, total: int) -> tuple[float, float]:
    from scipy.stats import binomtest  # slow to import, and workers judge nothing

    bounds = binomtest(count, total).proportion_ci(method="wilson")
    return float(bounds.low), float(bounds.high)


def _fraction_solved(final: np.ndarray, task: str, series: str | None, words: Words) -> Claim:
    path, name, reading = words
    solved = int(np.sum(final > TASKS[task].solved))
    bounds = _wilson(solved, final.size)
    theirs = PUBLISHED_SOLVED.get((task, series or ""))
    published, verdict = None, UNJUDGED
    if theirs is not None:
        published = theirs / PUBLISHED_RUNS
        verdict = _overlap(bounds, _wilson(theirs, PUBLISHED_RUNS))
    num_lost = int(np.sum(~np.isfinite(final)))
    statement = f"{name}: fraction of runs solved at the end"
    measured = solved / final.size
    return Claim(
        path, statement, published, measured, bounds, final.size, num_lost, reading, verdict
    )


def _first_solve(
    results: Results, returns: np.ndarray, condition: Condition, words: Words
) -> Claim:
    """Mean over the runs that solve the task at all, to the resolution of the evaluations."""
    path, name, reading = words
    solved = returns > TASKS[condition.environment].solved
    ever = solved.any(axis=1)
    steps = np.asarray(condition.times, dtype=np.float64)[solved.argmax(axis=1)][ever]
    ours, bounds = _mean(steps, results.seed)
    statement = f"{name}: steps to the first solve, mean over the runs that solve it"
    return Claim(path, statement, None, ours, bounds, steps.size, 0, reading, UNJUDGED)


def _comparisons(results: Results, arms: dict[str, str], reading: str) -> list[Claim]:
    """How often COPDAC-Q ends above each baseline on each task, and the paper's sentence."""
    claims = []
    for condition in results.study.conditions:
        ours = _returns(results, condition, COPDAC)[:, -1]
        for arm in arms.values():
            theirs = _returns(results, condition, arm)[:, -1]
            value, bounds = _probability_above(ours, theirs, results.seed)
            task = condition.environment
            path = f"above/{task}/{arm}".lower().replace(",", "").replace(" ", "-")
            statement = f"{task}: probability that a run of COPDAC-Q ends above one of {arm}"
            lost_runs = int(np.sum(~np.isfinite(ours)) + np.sum(~np.isfinite(theirs)))
            verdict = _above_half(bounds)
            claims.append(
                Claim(path, statement, None, value, bounds, ours.size, lost_runs, reading, verdict)
            )
    return [*claims, _at_least_as_good(claims, reading)]


def _at_least_as_good(claims: list[Claim], reading: str) -> Claim:
    """The weakest of the comparisons stands for all."""
    weakest = min(claims, key=lambda claim: claim.measured)
    verdicts = {claim.verdict for claim in claims}
    verdict: Verdict = "reproduced" if verdicts == {"reproduced"} else "inconclusive"
    if "not reproduced" in verdicts:
        verdict = "not reproduced"
    return Claim(
        id=f"at-least-as-good/{reading}".lower().replace(" ", "-"),
        statement="COPDAC-Q is at least as good as both baselines in all three tasks: least of the "
        "probabilities that one of its runs ends above one of theirs",
        published=None,
        measured=weakest.measured,
        interval=weakest.interval,
        num_runs=weakest.num_runs,
        num_diverged=max(claim.num_diverged for claim in claims),
        reading=reading,
        verdict=verdict,
    )


def _probability_above(
    ours: np.ndarray, theirs: np.ndarray, seed: int
) -> tuple[float, tuple[float, float]]:
    """P(ours > theirs) + P(equal) / 2 over all pairs of runs, each side resampled for itself."""
    above = (ours[:, None] > theirs) + 0.5 * (ours[:, None] == theirs)
    generator = np.random.default_rng(seed)
    rows, columns = (
        generator.multinomial(n, np.full(n, 1 / n), PROBABILITY_RESAMPLES) / n for n in above.shape
    )
    resampled = np.sum((rows @ above) * columns, axis=1)
    return float(above.mean()), interval(resampled)


def _above_half(bounds: tuple[float, float]) -> Verdict:
    low, high = bounds
    return "reproduced" if low > 0.5 else "not reproduced" if high < 0.5 else "inconclusive"


def _untrained(results: Results) -> list[Claim]:
    """Returns before learning: zero action, by which the tasks can be told from their like."""
    claims = []
    for condition in results.study.conditions:
        task = condition.environment
        first = _returns(results, condition, COPDAC)[:, 0]
        ours, bounds = _mean(first[np.isfinite(first)], results.seed)
        y, low, high = (float(c[0]) for c in published_curve("figure2", task, COPDAC, _ERRORS))
        half = max(1.96 * (high - low) / 2, SAME_TASK * abs(y))
        verdict = _overlap(bounds, (y - half, y + half))
        statement = f"{task}: return before learning (zero action)"
        claims.append(
            Claim(
                f"untrained/{task}",
                statement,
                y,
                ours,
                bounds,
                first.size,
                0,
                "The tasks",
                verdict,
            )
        )
    return claims
