"""Figure 1: the continuous bandit of Section 5.1, with every reading of its text that we found."""

import itertools

import numpy as np

from detpg.experiments.claims import (
    MAX_LOST,
    WITHIN,
    Claim,
    Ratio,
    Verdict,
    above_one,
    ratio_of_means,
    within_factor,
)
from detpg.experiments.published import published_value
from detpg.experiments.selection import lost
from detpg.experiments.study import Arm, Condition, Preset, Results, Study
from detpg.experiments.sweep import run_shard

DIMENSIONS = (10, 25, 50)
SPECTRA = ("mixed", "isotropic")
ACTORS = ("score-times-q", "score-times-advantage")
COPDAC = "COPDAC-B"
TIMES = (600, 10_000)
NUM_FINAL = 10
RECORDED = tuple(range(100, 10_001, 100))
SIGMAS = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0)

# The floors of the published curves imply a behaviour this wide, not the least of our grid.
PUBLISHED_WIDTH = "sigma=0.1"


def _decades(low: float, high: float, per_decade: int) -> tuple[float, ...]:
    """Powers of ten from 10^low to 10^high."""
    exponents = np.linspace(low, high, round((high - low) * per_decade) + 1)
    return tuple(float(f"{10**e:.3g}") for e in exponents)


def adapted(actor: str) -> str:
    """Name of SAC-B as in the paper, with mean and variance adapted."""
    return f"SAC-B {actor}"


def fixed(actor: str) -> str:
    """Name of SAC-B with its variance fixed: the control of Section 5.1."""
    return f"SAC-B {actor}, fixed variance"


# Each reading of SAC-B has quarter decades of alpha_theta around its own best, as COPDAC-B has. The
# advantage may start as narrow as COPDAC-B's behaviour; times Q, a start below 0.3 diverges.
_ADAPTED_GRIDS = {
    "score-times-q": (
        ("alpha_theta", _decades(-2.25, -0.25, 4)),
        ("alpha_y", _decades(-4.5, -1.5, 2)),
        ("sigma", (0.3, 1.0, 3.0, 10.0, 30.0)),
    ),
    "score-times-advantage": (
        ("alpha_theta", _decades(-1.75, 0.75, 4)),
        ("alpha_y", _decades(-5, -1, 1)),
        ("sigma", (0.001, 0.01, 0.1, 1.0, 3.0, 10.0)),
    ),
}
# The score grows like 1 / sigma: a narrow policy may need far smaller steps.
_FIXED_GRID = (
    ("alpha_theta", (1e-8, 1e-6, 1e-4, 1e-3, *_decades(-2.25, 0.75, 4))),
    ("sigma", (*SIGMAS, 3.0, 10.0)),
)
VERDICTS = (
    "A claim with a published number is *reproduced* if the whole 95% interval of ours lies "
    f"within a factor {WITHIN:g} of it, and *not reproduced* if the whole interval lies outside; a "
    "claim about a direction if the interval lies above or below 1; otherwise it is "
    "*inconclusive*. Intervals are percentile bootstraps over runs; runs that diverged are left "
    f"out of the means and counted, and with more than {MAX_LOST:.0%} of them the verdict is "
    "inconclusive. Costs at 10,000 steps are means of the last ten recordings, ours and the "
    "published ones."
)
_EVERY_THIRD = (("alpha_theta", 3), ("alpha_y", 3), ("sigma", 4))

ARMS = (
    Arm(
        COPDAC,
        "bandit-copdac",
        (),
        (("alpha_theta", _decades(-2, 1, 4)), ("sigma", SIGMAS)),
        profile="sigma",
    ),
    *(
        Arm(adapted(actor), "bandit-stochastic-ac", (("actor", actor),), _ADAPTED_GRIDS[actor])
        for actor in ACTORS
    ),
    *(
        Arm(
            fixed(actor),
            "bandit-stochastic-ac",
            (("actor", actor), ("fixed_variance", True)),
            _FIXED_GRID,
            profile="sigma",
        )
        for actor in ACTORS
    ),
)


def judge(results: Results) -> list[Claim]:
    """Every claim of Section 5.1 in every reading of its text."""
    actors = [actor for actor in ACTORS if adapted(actor) in results.points]
    claims: list[Claim] = []
    for spectrum, actor in itertools.product(SPECTRA, actors):
        for rule, width in itertools.product(results.study.rules, ("", f" {PUBLISHED_WIDTH}")):
            claims += _gap(results, spectrum, actor, rule, width)
        claims += _fixed_variance(results, spectrum, actor)
    return claims


def _condition(results: Results, m: int, spectrum: str) -> Condition:
    options = (("m", m), ("spectrum", spectrum))
    return next(c for c in results.study.conditions if c.options == options)


def _ratio(
    results: Results, m: int, spectrum: str, above: tuple[str, str], below: tuple[str, str], at: int
) -> Ratio:
    """Cost of one (arm, role) over that of another at a step, on the same seeds."""
    condition = _condition(results, m, spectrum)
    time = condition.times.index(at) + 1
    costs = []
    for arm, role in (above, below):
        runs = results.runs(condition, arm, role)
        values = runs[:, time - _num_points(at) : time].mean(axis=1)
        costs.append(np.where(lost(runs, results.study.lost_above), np.nan, values))
    return ratio_of_means(*costs, seed=results.seed + m)


def _num_points(at: int) -> int:
    """Recordings behind a cost: the end of a noisy curve is the mean of the last ten."""
    return NUM_FINAL if at == TIMES[-1] else 1


def _claim(
    path: str, statement: str, reading: str, published: float | None, ours: Ratio, verdict: Verdict
) -> Claim:
    return Claim(
        id=path,
        statement=statement,
        published=published,
        measured=ours.value,
        interval=ours.interval,
        num_runs=ours.num_runs,
        num_diverged=ours.num_diverged,
        reading=reading,
        verdict=verdict,
    )


def _gap(results: Results, spectrum: str, actor: str, rule: str, width: str) -> list[Claim]:
    """SAC-B over COPDAC-B at 600 and 10,000 steps, and how the ratio grows with m."""
    words = "0.1" if width else "the best of the grid"
    reading = f"C {spectrum}, SAC-B {actor}, both best by {rule} cost, COPDAC-B's sigma {words}"
    path = f"{spectrum}/{actor}/{rule}/{'sigma-0.1' if width else 'best-sigma'}"
    claims, final = [], []
    for at, m in itertools.product(TIMES, DIMENSIONS):
        ours = _ratio(results, m, spectrum, (adapted(actor), rule), (COPDAC, rule + width), at)
        theirs = [
            published_value("figure1", f"m={m}", series, at, _num_points(at))
            for series in ("SAC-B", "COPDAC-B")
        ]
        published = theirs[0] / theirs[1]
        claims.append(
            _claim(
                f"ratio-{at}/m-{m}/{path}",
                f"Cost of SAC-B over cost of COPDAC-B at {at:,} steps, m = {m}",
                reading,
                published,
                ours,
                within_factor(published, ours),
            )
        )
        final += [(published, ours)] if at == TIMES[-1] else []
    growth, expected = _growth(final)
    statement = (
        "The ratio at 10,000 steps grows with m: smallest factor from one m to the next "
        f"(published: {expected:.1f})"
    )
    claims.append(_claim(f"growth/{path}", statement, reading, None, growth, above_one(growth)))
    return claims


def _growth(final: list[tuple[float, Ratio]]) -> tuple[Ratio, float]:
    """Smallest factor between ratios of neighbouring dimensions, ours and the published one."""
    pairs = list(itertools.pairwise(final))
    values, resampled = (
        np.stack([part(big) / part(small) for (_, small), (_, big) in pairs])
        for part in (lambda ratio: np.float64(ratio.value), lambda ratio: ratio.resampled)
    )
    ours = Ratio(
        value=float(np.min(values)),
        resampled=np.min(resampled, axis=0),
        num_runs=min(ratio.num_runs for _, ratio in final),
        num_diverged=max(ratio.num_diverged for _, ratio in final),
    )
    return ours, min(big / small for (small, _), (big, _) in pairs)


def _fixed_variance(results: Results, spectrum: str, actor: str) -> list[Claim]:
    """The control: SAC-B with its variance fixed, at COPDAC-B's width and at its own best one."""
    shared = f"final {PUBLISHED_WIDTH}"
    least = f"final sigma={min(results.points[COPDAC]['sigma']):g}"
    comparisons = (
        (
            "fixed-both-0.1",
            "With both at sigma = 0.1, SAC-B of fixed variance costs more than COPDAC-B",
            (fixed(actor), shared),
            (COPDAC, shared),
        ),
        (
            "fixed-both-least",
            "With both at the least sigma of the grid, SAC-B of fixed variance costs more than "
            "COPDAC-B",
            (fixed(actor), least),
            (COPDAC, least),
        ),
        (
            "fixed-both-best",
            "With each at its best sigma, SAC-B of fixed variance costs more than COPDAC-B",
            (fixed(actor), "final"),
            (COPDAC, "final"),
        ),
        (
            "fixed-no-better",
            "Fixing SAC-B's variance at 0.1 does not improve it: fixed over adapted",
            (fixed(actor), shared),
            (adapted(actor), "final"),
        ),
    )
    reading = f"C {spectrum}, SAC-B {actor}, variance fixed, best by final cost"
    claims = []
    for name, statement, above, below in comparisons:
        ratios = []
        for m in DIMENSIONS:
            ours = _ratio(results, m, spectrum, above, below, TIMES[-1])
            path, words = f"{name}/m-{m}/{spectrum}/{actor}", f"{statement}: ratio, m = {m}"
            claims.append(_claim(path, words, reading, None, ours, above_one(ours)))
            ratios.append((1.0, ours))
        if name == "fixed-both-0.1":
            growth, _ = _growth(ratios)
            words = "That ratio grows with m: smallest factor from one m to the next"
            path = f"fixed-growth/{spectrum}/{actor}"
            claims.append(_claim(path, words, reading, None, growth, above_one(growth)))
    return claims


FIGURE1 = Study(
    name="figure1",
    title="Continuous bandit: SAC-B against COPDAC-B",
    section="5.1",
    claim="The deterministic actor-critic reaches a far lower cost than the stochastic one, and "
    "the gap grows with the dimension of the action.",
    conditions=tuple(
        Condition("bandit", (("m", m), ("spectrum", spectrum)), RECORDED)
        for spectrum, m in itertools.product(SPECTRA, DIMENSIONS)
    ),
    arms=ARMS,
    metric="cost of the mean action, before the update of its batch",
    measured="cost",
    lost_above=1000.0,
    num_final=NUM_FINAL,
    rules=("final", "mean"),
    verdicts=VERDICTS,
    presets={
        "smoke": Preset(
            _EVERY_THIRD,
            sweep_seeds=5,
            fresh_seeds=5,
            interval_seeds=0,
            shard=(16, 5),
            without=(adapted(ACTORS[1]), fixed(ACTORS[1])),
        ),
        "quick": Preset((), 3, fresh_seeds=5, interval_seeds=0, shard=(32, 3)),
        "paper": Preset((), 5, fresh_seeds=5, interval_seeds=100, shard=(32, 5)),
    },
    run_shard=run_shard,
    judge=judge,
)
