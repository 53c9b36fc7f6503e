"""The checks and their points as files: JSON for programs, Markdown for people, a tidy table."""

import csv
import io
import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from detpg.runs import provenance, write_atomically
from detpg.theorems.record import WIDEST, Check, Group, Point, rounding

POINTS, CHECKS, PAGE = "points.csv", "checks.json", "checks.md"
SIGNS = {"within": "", "at least": "≥ ", "at most": "≤ "}
RULE = (
    "A check passes if every measured number lies within its tolerance of the expected one; where "
    "the expected one has a sign ≥ or ≤, if the measured one, less or plus its tolerance, lies on "
    "that side. Tolerances are 4 standard errors, or rounding in double precision (100 roundings "
    "times a condition number). Standard errors are over independent samples, blocks, estimates or "
    f"runs; that of an exponent is from the scatter about the line where the points are exact, and "
    "else from the errors of the points or the exponents of the blocks. The tolerance of an "
    f"exponent is that, plus a rounding of {rounding(1e3):.1g}, and never more than {WIDEST:g}. "
    "Where a tolerance is shown as -, the expected number is a margin that was chosen, away from "
    "the measured one. Nothing is random between runs: the seeds are fixed."
)


def as_json(groups: dict[str, Group]) -> dict[str, Any]:
    """What `detpg verify --json` prints."""
    return {"checks": [check.as_json() for group in groups.values() for check in group.checks]}


def write(groups: dict[str, Group], directory: Path) -> None:
    """Writes `checks.json`, `checks.md` and `points.csv`, each whole or not at all."""
    content = {**as_json(groups), "provenance": provenance({})}
    files = {
        CHECKS: json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False) + "\n",
        PAGE: page(groups),
        POINTS: table(groups),
    }
    for name, text in files.items():
        write_atomically(directory / name, lambda file, data=text: file.write(data.encode()))


def table(groups: dict[str, Group]) -> str:
    """One row for each point, as CSV."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("group", *Point._fields))
    for name, group in groups.items():
        for point in group.points:
            numbers = (f"{number:.8g}" for number in (point.x, point.y, point.error))
            writer.writerow((name, *point[:3], *numbers))
    return text.getvalue()


def page(groups: dict[str, Group]) -> str:
    """Markdown: a table for each group; the groups can be included by name in other pages."""
    checks = [check for group in groups.values() for check in group.checks]
    passed = sum(check.passed for check in checks)
    lines = [
        "# The theorems, checked",
        "",
        f"`detpg verify`: {passed} of {len(checks)} checks passed.",
        "",
        RULE,
        "",
    ]
    for name, group in groups.items():
        lines += [f"## {group.title}", "", f"<!-- --8<-- [start:{name}] -->", ""]
        lines += [*_rows(group.checks), "", f"<!-- --8<-- [end:{name}] -->", ""]
    return "\n".join(lines).rstrip() + "\n"


def _rows(checks: Iterable[Check]) -> list[str]:
    head = ["check", "statement", "measured", "expected", "tolerance", "passed"]
    rows = [head, ["---"] * len(head)]
    rows += [[f"`{c.id}`", c.statement, *columns(c), _verdict(c)] for c in checks]
    return ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]


def _verdict(check: Check) -> str:
    return "yes" if check.passed else "**no**"


def columns(check: Check) -> tuple[str, str, str]:
    """Measured, expected and tolerance as a person reads them."""
    digits = check.tolerance * (len(check.measured) if len(check.tolerance) == 1 else 1)
    measured = ", ".join(number(*pair) for pair in zip(check.measured, digits, strict=True))
    spread = digits if len(check.expected) > 1 else check.tolerance
    expected = ", ".join(number(*pair) for pair in zip(check.expected, spread))
    tolerance = ", ".join(f"{size:.2g}" for size in check.tolerance)
    return measured, SIGNS[check.relation] + expected, "-" if tolerance == "0" else tolerance


def number(value: float, tolerance: float = 0.0) -> str:
    """As many digits as the tolerance leaves meaning, and one more; else three significant ones."""
    if not math.isfinite(value):
        return "not finite"
    if value == 0:
        return "0"
    if 0 < tolerance <= abs(value):
        digits = math.floor(math.log10(abs(value))) - math.floor(math.log10(tolerance)) + 2
        return f"{value:.{min(digits, 12)}g}"
    return f"{value:.3g}" if tolerance == 0 else f"{value:.2g}"
