"""`detpg plot`: learning curves of runs, compared."""

import dataclasses
from pathlib import Path
from typing import Annotated, Literal

import tyro

from detpg.cli.errors import UserError
from detpg.cli.outputs import check_writable, checked_kind, unwritable

KINDS = ("png", "svg", "pdf")


@dataclasses.dataclass(frozen=True)
class Plot:
    """Draws learning curves of runs, and writes the plotted numbers beside them as CSV.

    A line for each run: the IQM or the mean over its training seeds with a 95% bootstrap interval,
    each seed as a thin line. Runs in different environments go to separate panels. A run of one
    seed has no interval.
    """

    runs: Annotated[
        tyro.conf.Positional[tuple[Path, ...]],
        tyro.conf.arg(metavar="RUN [RUN ...]", help_behavior_hint="(required)"),
    ]
    """Folders that `detpg train` has written; of runs that still go on, what there is."""

    metric: Annotated[str, tyro.conf.arg(metavar="NAME")] = "return"
    """return or length (of evaluations), or of training: an unknown name lists what there is."""

    statistic: Literal["iqm", "mean"] = "iqm"
    """Over the seeds: the mean of their middle half, or of all; of fewer than 4 they are one."""

    output: Annotated[
        Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: NAME.png)")
    ] = None
    """File to write, .png, .svg or .pdf; the .csv has the same stem. Those there are replaced."""

    def run(self) -> None:
        """Reads the runs, draws, and says where the files are.

        Raises:
            UserError: A run, metric or file that cannot be used; nothing was written.
        """
        output = self.output or Path(f"{self.metric.rpartition('/')[2]}.png")
        output = output.with_suffix(f".{checked_kind(output, KINDS)}")
        if not self.runs:
            raise UserError("no run is named: give one folder or more that `detpg train` wrote.")
        for file in (output, output.with_suffix(".csv")):
            check_writable(file)
        from detpg.figures.curves import draw

        try:
            picture, table = draw(self.runs, self.metric, output, self.statistic)
        except ValueError as error:
            raise UserError(str(error)) from error
        except OSError as error:
            raise unwritable(output, error) from error
        print(f"written to {picture} and {table}")
