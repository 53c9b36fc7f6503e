"""`detpg reproduce`: the paper's figures, from nothing to a verdict."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from detpg.cli.errors import UserError
from detpg.machine import cores

if TYPE_CHECKING:
    from rich.progress import TaskID

    from detpg.experiments import Study


@dataclasses.dataclass(frozen=True)
class Reproduce:
    """Reproduces figures of the paper: sweep, figure, and a report that judges its claims.

    Stopping it and running the same command again continues where it stood. A finished figure is
    not run again.
    """

    figures: Annotated[
        tyro.conf.Positional[tuple[str, ...]],
        tyro.conf.arg(metavar="[FIGURE ...]", help_behavior_hint="(default: all)"),
    ] = ()
    """Figures to reproduce, such as figure1 (see `detpg list`)."""

    preset: Literal["smoke", "quick", "paper"] = "quick"
    """How much is run: does it work; the figure; that with a wider sweep or 100 further runs."""

    output: Annotated[Path, tyro.conf.arg(metavar="DIR")] = Path("reproduction")
    """Folder to write to; each figure gets a folder of its own in it."""

    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Of everything random, 0 to 2147483647."""

    workers: Annotated[
        int | None,
        tyro.conf.arg(metavar="N", help_behavior_hint="(default: one for each core)"),
    ] = None
    """Worker processes, at most one for each core; the results do not depend on it."""

    fresh: bool = False
    """Start over: remove what an earlier run of the named figures left in the folder."""

    def run(self) -> None:
        """Runs the figures one after the other.

        Raises:
            UserError: A figure, number or folder that cannot be used; nothing was touched.
        """
        self._check_numbers()
        from detpg.experiments import STUDIES

        unknown = [name for name in self.figures if name not in STUDIES]
        if unknown:
            known = ", ".join(STUDIES)
            raise UserError(f"figure {unknown[0]!r} is unknown: choose from {known}.")
        for name in dict.fromkeys(self.figures or STUDIES):
            self._reproduce(STUDIES[name].at(self.preset))

    def _check_numbers(self) -> None:
        if not 0 <= self.seed < 2**31:
            raise UserError(f"--seed {self.seed} cannot be used: give 0 to {2**31 - 1}.")
        if self.workers is not None and not 1 <= self.workers <= cores():
            raise UserError(
                f"--workers {self.workers} cannot be used: give 1 to {cores()}, the number of "
                "cores."
            )

    def _reproduce(self, study: "Study") -> None:
        from detpg.executors import WorkerLostError
        from detpg.experiments.reproduce import Reproduction, run_directory
        from detpg.figures import draw, missing
        from detpg.runs import RunDirectoryError

        directory = run_directory(study, self.preset, self.seed, self.output)
        try:
            with directory.opened(self.fresh):
                new = not directory.finished
                if new:
                    with _progress(study.name) as progress:
                        workers = self.workers or cores()
                        run = Reproduction(
                            study, self.preset, self.seed, workers, directory, progress
                        )
                        run.run()
                if new or missing(study.name, directory.path):
                    draw(study.name, directory.path)
        except (RunDirectoryError, WorkerLostError) as error:
            raise UserError(str(error)) from error
        except OSError as error:
            raise UserError(f"{directory.path} cannot be written to ({error.strerror}).") from error
        _announce(study.name, directory.path, new)


class _progress:  # noqa: N801  (used like the function that it wraps)
    """A bar on a terminal; elsewhere a plain line for each tenth of a phase."""

    def __init__(self, figure: str):
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            Progress,
            TaskProgressColumn,
            TextColumn,
            TimeElapsedColumn,
            TimeRemainingColumn,
        )

        self._console = Console(stderr=True)
        self._figure = figure
        self._tasks: dict[str, TaskID] = {}
        self._tenths: dict[str, int] = {}
        self._bars = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TaskProgressColumn(),
            TextColumn("{task.fields[speed]}"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=self._console,
            disable=not self._console.is_terminal,
        )

    def __enter__(self) -> Callable[[str, int, int, float], None]:
        self._bars.start()
        return self._show

    def __exit__(self, *_: object) -> None:
        self._bars.stop()

    def _show(self, phase: str, done: int, total: int, rate: float) -> None:
        label, speed = f"{self._figure}: {phase}", f"{rate:,.0f} steps/s"
        if not self._console.is_terminal:
            tenth = done * 10 // total
            if tenth != self._tenths.get(phase):
                self._tenths[phase] = tenth
                self._console.print(f"{label} {done / total:.0%}, {speed}", highlight=False)
            return
        if phase not in self._tasks:
            self._tasks[phase] = self._bars.add_task(label, total=total, speed="")
        self._bars.update(self._tasks[phase], completed=done, speed=speed)


def _announce(name: str, path: Path, new: bool) -> None:
    """Says where things are and how the claims stand."""
    import json
    from collections import Counter

    claims = json.loads((path / "summary.json").read_text())["claims"]
    counts = Counter(claim["verdict"] for claim in claims)
    verdicts = ", ".join(f"{number} {verdict}" for verdict, number in counts.most_common())
    print(f"{name}: {'done' if new else 'was already finished (--fresh runs it again)'}")
    print(f"  figures  {path / (name + '.png')} and beside it")
    print(f"  claims   {path / 'claims.md'} ({len(claims)}: {verdicts})")
