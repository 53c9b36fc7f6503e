"""Choosing the best points of a grid on the sweep seeds, and saying where they lie."""

import dataclasses
from typing import Literal

import numpy as np

Rule = Literal["final", "mean"]


@dataclasses.dataclass(frozen=True)
class Choice:
    """One chosen point.

    Attributes:
        role: "final" or "mean" for the best of the grid by that rule; "final sigma=0.1" and the
            like for the best with one value held.
        rule: What it was chosen by, see `score`.
        index: Its place in the grid.
        score: Its mean score on the sweep seeds (lower is better).
        edges: Hyper-parameters, other than the held one, whose value lies on an edge of the grid.
    """

    role: str
    rule: Rule
    index: int
    score: float
    edges: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class Selection:
    """The chosen points of one learner on one problem.

    Attributes:
        choices: One for each role.
        num_diverged: Runs of the sweep, over all points, that diverged.
        num_runs: Runs of the sweep.
    """

    choices: tuple[Choice, ...]
    num_diverged: int
    num_runs: int

    @property
    def indices(self) -> list[int]:
        return [choice.index for choice in self.choices]

    def row(self, role: str) -> int:
        """Where a role stands among the choices."""
        return [choice.role for choice in self.choices].index(role)


def lost(costs: np.ndarray, above: float | None) -> np.ndarray:
    """Whether each run has diverged: a number that is not finite, or an end above `above`.

    Args:
        costs: Shape (..., time).
        above: A cost that no start has; see `Study.lost_above`.
    """
    highest = np.inf if above is None else above
    return ~np.isfinite(costs).all(axis=-1) | ~(costs[..., -1] <= highest)


def score(costs: np.ndarray, rule: Rule, above: float | None, num_final: int) -> np.ndarray:
    """One number per run, lower is better; infinite for a run that has diverged.

    Args:
        costs: Shape (..., time).
        rule: "final": mean of the last recordings. "mean": mean of all, which is the area under
            the curve.
        above: See `lost`.
        num_final: How many recordings count as the last.
    """
    kept = costs[..., -num_final:] if rule == "final" else costs
    with np.errstate(all="ignore"):
        means = np.mean(kept, axis=-1, dtype=np.float64)
    return np.where(lost(costs, above), np.inf, means)


def select(
    costs: np.ndarray,
    points: dict[str, np.ndarray],
    rules: tuple[Rule, ...],
    profile: str | None,
    above: float | None,
    num_final: int,
) -> Selection:
    """The best point by each rule, over the whole grid and at each value of `profile`.

    Args:
        costs: Shape (points, seeds, time).
        points: Hyper-parameter -> value at each point.
        rules: See `score`.
        profile: Hyper-parameter to hold, or None.
        above: See `lost`.
        num_final: See `score`.
    """
    everywhere = np.arange(len(costs))
    choices = []
    for rule in rules:
        scores = score(costs, rule, above, num_final).mean(axis=-1)
        choices.append(_choose(rule, rule, scores, points, everywhere))
        if profile is None:
            continue
        for value in np.unique(points[profile]):
            held = np.flatnonzero(points[profile] == value)
            role = f"{rule} {profile}={value:g}"
            choices.append(_choose(role, rule, scores, points, held))
    return Selection(
        choices=tuple(choices),
        num_diverged=int(np.sum(lost(costs, above))),
        num_runs=costs.shape[0] * costs.shape[1],
    )


def _choose(
    role: str, rule: Rule, scores: np.ndarray, points: dict[str, np.ndarray], among: np.ndarray
) -> Choice:
    best = int(among[np.argmin(scores[among])])
    edges = [
        name
        for name, values in points.items()
        if np.unique(values[among]).size > 1 and values[best] in (values.min(), values.max())
    ]
    return Choice(role, rule, best, float(scores[best]), tuple(edges))
