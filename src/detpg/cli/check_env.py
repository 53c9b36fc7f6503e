"""`detpg check-env`: what stands in the way of learning in an environment."""

import dataclasses
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from detpg.cli.errors import UserError
from detpg.cli.json_output import print_json
from detpg.cli.opened import environment_options

if TYPE_CHECKING:
    from detpg.testing import Finding

STYLES = {"problem": "bold red", "warning": "yellow", "fine": "green"}


@dataclasses.dataclass(frozen=True)
class CheckEnv:
    """Plays an environment at random and says what may stand in the way of learning, in words.

    Ends with exit code 1 if there is a problem; warnings alone end with 0.
    """

    environment: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="ENVIRONMENT")]
    """A Gymnasium id, such as Pendulum-v1 or mine:World-v0, or a name of `detpg list`."""

    steps: Annotated[int, tyro.conf.arg(metavar="N")] = 2000
    """Random actions to try, 1 or more."""

    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Of everything random, 0 to 2147483647."""

    time_limit: Annotated[
        int | None, tyro.conf.arg(metavar="N", help_behavior_hint="(default: the registered one)")
    ] = None
    """Steps after which an episode is truncated, 1 or more."""

    environment_option: Annotated[
        tuple[str, ...], tyro.conf.arg(metavar="NAME=VALUE ...", help_behavior_hint="")
    ] = ()
    """Of the environment, such as g=9.81; several may follow, as in `detpg train`."""

    json: bool = False
    """Print JSON instead of a table."""

    def run(self) -> None:
        """Checks the environment and prints what was found.

        Raises:
            UserError: A number that cannot be used, or an environment that cannot be built.
            SystemExit: With code 1 if there is a problem.
        """
        ranges = {"steps": (1, 10**9), "seed": (0, 2**31 - 1), "time_limit": (1, 2**31 - 1)}
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                flag = name.replace("_", "-")
                raise UserError(f"--{flag} {value} cannot be used: give {low} to {high}.")
        findings = self._findings()
        if self.json:
            _print_json(self.environment, findings)
        else:
            _print_table(self.environment, findings)
        if any(finding.level == "problem" for finding in findings):
            raise SystemExit(1)

    def _findings(self) -> "list[Finding]":
        from detpg.environments import ENVIRONMENTS
        from detpg.testing import check_gymnasium
        from detpg.world_error import WorldError

        options = environment_options(self.environment_option)
        try:
            if self.environment in ENVIRONMENTS:
                return _conformance(self.environment, options)
            return check_gymnasium(
                self.environment,
                steps=self.steps,
                seed=self.seed,
                time_limit=self.time_limit,
                options=options,
            )
        except (ValueError, WorldError) as error:
            raise UserError(str(error)) from error


def _conformance(name: str, options: dict[str, Any]) -> "list[Finding]":
    """Of this library's own environments: do they keep the protocol?"""
    from detpg.environments import ENVIRONMENTS
    from detpg.testing import Finding, check_environment
    from detpg.workbench.compiled import built

    environment = built(ENVIRONMENTS[name], name, options)
    try:
        check_environment(environment)
    except AssertionError as error:
        return [Finding("problem", "conformance", str(error))]
    return [Finding("fine", "conformance", "It keeps the protocol detpg.types.Environment.")]


def _print_json(environment: str, findings: "list[Finding]") -> None:
    found = [dataclasses.asdict(finding) for finding in findings]
    print_json({"environment": environment, "findings": found})


def _print_table(environment: str, findings: "list[Finding]") -> None:
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=environment, title_justify="left", show_lines=True)
    table.add_column("level", no_wrap=True)
    for name, ratio in (("what", 1), ("found", 3), ("what to do", 3)):
        table.add_column(name, ratio=ratio, overflow="fold")  # a long name is not cut
    for finding in findings:
        level = f"[{STYLES[finding.level]}]{finding.level}[/]"
        table.add_row(level, *map(escape, (finding.check, finding.found, finding.advice)))
    console = Console()
    console.print(table)
    levels = [finding.level for finding in findings]
    console.print(", ".join(_counted(levels, level) for level in ("problem", "warning")))


def _counted(levels: list[str], level: str) -> str:
    number = levels.count(level)
    return f"{number} {level}{'' if number == 1 else 's'}"
