"""`detpg verify`: the theorems of the paper, checked."""

import dataclasses
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from detpg.cli.errors import UserError
from detpg.cli.json_output import print_json

if TYPE_CHECKING:
    from detpg.theorems import Group


@dataclasses.dataclass(frozen=True)
class Verify:
    """Checks the theorems of the paper, each number beside what it must be; about a minute.

    Ends with exit code 1 if a check fails.
    """

    json: bool = False
    """Print JSON instead of tables."""

    output: Annotated[
        Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(default: none)")
    ] = None
    """Folder for checks.json, checks.md, points.csv and the pictures; made where it is missing."""

    def run(self) -> None:
        """Runs all checks, prints them, and writes them if told to.

        Raises:
            UserError: A folder that cannot be written to, before anything is run; or a file in
                it that cannot be, after the checks are printed.
            SystemExit: With code 1 if a check fails.
        """
        if self.output is not None:
            _check_writable(self.output)
        from detpg.theorems import verify
        from detpg.theorems.report import as_json

        groups = verify(_say_nothing if self.json else _say_what_runs)
        if self.json:
            print_json(as_json(groups))
        else:
            _print_tables(groups)
        if self.output is not None:
            self._write(groups, self.output)
        if not all(check.passed for group in groups.values() for check in group.checks):
            raise SystemExit(1)

    def _write(self, groups: "dict[str, Group]", output: Path) -> None:
        from detpg.figures import draw
        from detpg.theorems.report import write

        try:
            write(groups, output)
            draw("theorems", output)
        except OSError as error:
            raise UserError(f"{output} cannot be written to ({error.strerror}).") from error
        if not self.json:
            print(f"written to {output}: checks.json, checks.md, points.csv and pictures")


def _check_writable(output: Path) -> None:
    """Before a minute is spent on what could not be kept."""
    try:
        output.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=output):
            pass
    except OSError as error:
        raise UserError(
            f"{output} cannot be written to ({error.strerror}): choose another --output."
        ) from error


def _say_nothing(name: str) -> None:
    pass


def _say_what_runs(name: str) -> None:
    from rich.console import Console

    Console(stderr=True).print(f"verify: {name}", highlight=False)


def _print_tables(groups: "dict[str, Group]") -> None:
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from detpg.theorems.report import columns

    console = Console()
    for group in groups.values():
        table = Table(title=group.title, title_justify="left", expand=True, show_lines=True)
        table.add_column("statement", ratio=3)
        for name in ("measured", "expected", "tolerance"):
            table.add_column(name, ratio=1)
        table.add_column("passed", no_wrap=True)
        for check in group.checks:
            verdict = "[green]yes[/green]" if check.passed else "[bold red]NO[/bold red]"
            table.add_row(escape(check.statement), *map(escape, columns(check)), verdict)
        console.print(table)
    checks = [check for group in groups.values() for check in group.checks]
    failed = [check.id for check in checks if not check.passed]
    verdict = f"; failed: {', '.join(failed)}" if failed else ""
    console.print(f"{len(checks) - len(failed)} of {len(checks)} checks passed{verdict}")
