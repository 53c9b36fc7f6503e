"""The report of claims, for people."""

import itertools
import math
from collections import Counter
from typing import Any

from detpg.experiments.claims import Claim
from detpg.experiments.study import Study


def claims_page(
    study: Study, preset: str, seed: int, selected: list[dict[str, Any]], claims: list[Claim]
) -> str:
    """Markdown: the claims by reading, the rule that judges them, the chosen points.

    Args:
        study: What was run.
        preset: How much of it.
        seed: The study's seed.
        selected: One record for each learner on each problem, as in `summary.json`.
        claims: Judged claims, those of one reading side by side.
    """
    counts = Counter(claim.verdict for claim in claims)
    unjudged = counts["no number to compare"]
    head = [
        f"# {study.name}: {study.title}",
        "",
        f"Section {study.section} of Silver et al. (2014). {study.claim}",
        "",
        f"Preset `{preset}`, seed {seed}: {counts['reproduced']} of {len(claims) - unjudged} "
        f"claims reproduced, {counts['not reproduced']} not, {counts['inconclusive']} inconclusive"
        + (f"; {unjudged} further measurements have no published number." if unjudged else "."),
        "",
        study.verdicts,
        "",
    ]
    body = []
    for reading, members in itertools.groupby(claims, lambda claim: claim.reading):
        body += [f"## {reading}", "", *_table(list(members)), ""]
    return "\n".join([*head, *body, *_selected_table(selected, study)]) + "\n"


def _table(claims: list[Claim]) -> list[str]:
    rows = [
        f"| {c.statement} | {'-' if c.published is None else number(c.published)} | "
        f"{number(c.measured)} | {number(c.interval[0])} to {number(c.interval[1])} | "
        f"{_runs(c)} | **{c.verdict}** |"
        for c in claims
    ]
    return [
        "| claim | published | measured | 95% interval | runs | verdict |",
        "| --- | --- | --- | --- | --- | --- |",
        *rows,
    ]


def _runs(claim: Claim) -> str:
    diverged = f" ({claim.num_diverged} diverged)" if claim.num_diverged else ""
    return f"{claim.num_runs}{diverged}"


_RULES = {
    "final": lambda study: f"the final {study.measured} ({_last(study.num_final)})",
    "mean": lambda study: f"the mean {study.measured} (of all recordings)",
}


def _last(num_final: int) -> str:
    return "the last recording" if num_final == 1 else f"mean of the last {num_final} recordings"


def _selected_table(selected: list[dict[str, Any]], study: Study) -> list[str]:
    """The best points with both scores, and what lies on an edge of its grid."""
    rules = " or by ".join(_RULES[rule](study) for rule in study.rules)
    options = list(itertools.takewhile(lambda name: name != "arm", selected[0]))
    lines = [
        "## The chosen points",
        "",
        f"Chosen on the sweep seeds by {rules}; the score on fresh seeds is the honest one. A "
        "value in bold lies on an edge of its grid.",
        "",
        "| "
        + " | ".join(options)
        + " | learner | by | point | sweep score | fresh score | diverged: "
        "sweep | fresh |",
        "| " + " | ".join("---" for _ in range(len(options) + 7)) + " |",
    ]
    for row in selected:
        point = ", ".join(
            f"{name} = **{value:g}**" if name in row["on_edge"] else f"{name} = {value:g}"
            for name, value in row["point"].items()
        )
        scores = " | ".join(number(row[key]) for key in ("sweep_score", "fresh_score"))
        lines.append(
            "| " + " | ".join(str(row[name]) for name in options) + f" | {row['arm']} | "
            f"{row['chosen_by']} | {point} | {scores} | "
            f"{row['sweep_runs_diverged']} of {row['sweep_runs']} | "
            f"{row['fresh_runs_diverged']} of {row['fresh_runs']} |"
        )
    return lines


def number(value: float | None) -> str:
    """Three significant digits, readable from 1e-9 to 1e9; what diverged is called so."""
    if value is None or not math.isfinite(value):
        return "diverged"
    if value == 0 or 0.001 <= abs(value) < 10_000:
        return f"{value:.3g}"
    mantissa, exponent = f"{value:.1e}".split("e")
    return f"{mantissa}e{int(exponent)}"
