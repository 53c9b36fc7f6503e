"""Writes the pages that are made from the code; with --check, says whether one is out of date.

Usage: python docs/generate.py [--check]
"""

import argparse
import inspect
import os
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any, get_args

from detpg.algorithms import ALGORITHMS
from detpg.experiments import STUDIES
from detpg.experiments.study import Study
from detpg.types import Algorithm, hyper_parameters, switches

DOCS = Path(__file__).resolve().parent
COMMANDS: tuple[tuple[str, ...], ...] = (
    (),
    ("train",),
    ("train", "copdac-q"),
    ("resume",),
    ("evaluate",),
    ("plot",),
    ("render",),
    ("export",),
    ("check-env",),
    ("reproduce",),
    ("verify",),
    ("list",),
)
MADE = "<!-- Made by docs/generate.py: change the code, not this page. -->"


def main() -> None:
    parser = argparse.ArgumentParser(description="Writes the pages that are made from the code.")
    parser.add_argument("--check", action="store_true", help="write nothing, fail if out of date")
    check = parser.parse_args().check
    pages = {
        "reference/hyperparameters.md": hyperparameters(),
        "reference/updates.md": updates(),
        "reference/studies.md": studies(),
        "cli.md": command_line(),
    }
    stale = [name for name, text in pages.items() if text != current(DOCS / name)]
    if check and stale:
        sys.exit(f"Out of date: docs/{', docs/'.join(stale)}; run python docs/generate.py.")
    for name in stale:
        (DOCS / name).parent.mkdir(exist_ok=True)
        (DOCS / name).write_text(pages[name], encoding="utf-8")


def current(path: Path) -> str | None:
    """What stands in a file; None where there is none."""
    return path.read_text(encoding="utf-8") if path.exists() else None


def section(name: str, lines: list[str]) -> list[str]:
    """Lines that other pages can include by name (pymdownx.snippets)."""
    return [f"<!-- --8<-- [start:{name}] -->", "", *lines, "", f"<!-- --8<-- [end:{name}] -->", ""]


def page(lines: list[str]) -> str:
    return "\n".join([MADE, "", *lines]).rstrip() + "\n"


def hyperparameters() -> str:
    """A table for each registered algorithm."""
    lines = ["# Hyper-parameters", ""]
    for name, algorithm in ALGORITHMS.items():
        lines += [f"## {name}", "", *section(name, hyper_table(algorithm))]
    return page(lines)


def hyper_table(algorithm: type[Algorithm]) -> list[str]:
    rows = [
        f"| `{key}` | {known.doc} | {known.default:g} | {known.low:g} | {known.high:g} |"
        for key, known in hyper_parameters(algorithm).items()
    ]
    return [
        f"`detpg.algorithms.{algorithm.__name__}`. Lines of the paper: {algorithm.equations}.",
        "",
        "| name | meaning | default | least | greatest |",
        "| --- | --- | --- | --- | --- |",
        *rows,
        *switch_table(algorithm),
    ]


def switch_table(algorithm: type[Algorithm]) -> list[str]:
    """Options that are no real numbers; nothing where there are none."""
    rows = [
        f"| `{key}` | {field.metadata['switch']} | `{field.default}` | {choices(field.type)} |"
        for key, field in switches(algorithm).items()
    ]
    head = ["", "| switch | what it does | default | choices |", "| --- | --- | --- | --- |"]
    return [*head, *rows] if rows else []


def choices(kind: Any) -> str:
    if kind is int:
        return "whole numbers"
    return ", ".join(f"`{choice}`" for choice in get_args(kind) or (False, True))


def updates() -> str:
    """The update of each registered algorithm, as it stands in its file."""
    lines: list[str] = []
    for name, algorithm in ALGORITHMS.items():
        code = textwrap.dedent(inspect.getsource(algorithm.update)).rstrip()
        lines += section(name, ["```python", code, "```"])
    return page(lines)


def studies() -> str:
    """What each study runs: its learners' grids and its presets."""
    lines: list[str] = []
    for name, study in STUDIES.items():
        lines += section(f"{name}-grids", grid_table(study))
        lines += section(f"{name}-presets", preset_table(study))
    return page(lines)


def grid_table(study: Study) -> list[str]:
    rows = []
    for arm in study.arms:
        axes = "; ".join(
            f"`{axis}`: {', '.join(f'{value:g}' for value in values)}" for axis, values in arm.grid
        )
        points = len(next(iter(arm.points().values())))
        rows.append(f"| {arm.name} | {axes} | {points} |")
    return ["| learner | grid | points |", "| --- | --- | --- |", *rows]


def preset_table(study: Study) -> list[str]:
    rows = []
    for name, preset in study.presets.items():
        thin = ", ".join(f"every {k} of `{axis}`" for axis, k in preset.thin) or "whole"
        without = "; ".join(preset.without) or "none"
        rows.append(
            f"| `{name}` | {thin} | {without} | {preset.sweep_seeds} | {preset.fresh_seeds} | "
            f"{preset.interval_seeds} |"
        )
    return [
        "| preset | grid | learners left out | sweep seeds | fresh seeds | further fresh seeds |",
        "| --- | --- | --- | --- | --- | --- |",
        *rows,
    ]


def command_line() -> str:
    """The help of every command, as a terminal of 100 columns shows it."""
    lines = ["# Command line", ""]
    for command in COMMANDS:
        title = " ".join(("detpg", *command))
        lines += [f"## {title}", "", "```text", f"$ {title} --help", help_text(command), "```", ""]
    return page(lines)


def help_text(command: tuple[str, ...]) -> str:
    plain = {"COLUMNS": "100", "NO_COLOR": "1", "TERM": "dumb", "PYTHONIOENCODING": "utf-8"}
    run = subprocess.run(
        [sys.executable, "-m", "detpg", *command, "--help"],
        capture_output=True,
        encoding="utf-8",
        env=os.environ | plain,
    )
    if run.returncode != 0:
        words = " ".join(("detpg", *command, "--help"))
        sys.exit(f"{words} failed: {(run.stderr.strip().splitlines() or ['no message'])[-1]}")
    return "\n".join(line.rstrip() for line in run.stdout.strip().splitlines())


if __name__ == "__main__":
    main()
