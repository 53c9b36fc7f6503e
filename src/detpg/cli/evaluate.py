"""`detpg evaluate`: what a learnt policy earns, and how sure that is."""

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from detpg.cli.errors import UserError
from detpg.cli.json_output import print_json
from detpg.cli.opened import OwnEnvironment, OwnPolicy, opened, told

if TYPE_CHECKING:
    import numpy as np

    from detpg.evaluation import Estimate, Summary
    from detpg.workbench import Config

MOST_EPISODES = 100_000
FEW = 20  # below as many scores the interval is visibly too narrow


@dataclasses.dataclass(frozen=True)
class Evaluate:
    """Plays episodes with the policies of a run, without noise; says what they earn.

    Prints the mean and the interquartile mean (IQM) of the return, each with a 95% bootstrap
    interval: over the run's training seeds where it has several, else over the episodes.
    """

    path: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(name="run", metavar="RUN")]
    """Folder that `detpg train` has written."""

    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 10
    """Episodes for each training seed's policy, 1 to 100000."""

    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Of the episodes' starts and the world's noise, 0 to 2147483647."""

    policy: Literal["best", "last"] = "best"
    """The policy of the best evaluation while training, or the one trained longest."""

    own_policy: OwnPolicy = None
    """Policy of your own, if the run was trained with one: code is never loaded from a run."""

    own_environment: OwnEnvironment = None
    """The run's environment, if it is one of your own that a module registers."""

    episodes_table: bool = False
    """Print a row for each episode also where there are several training seeds."""

    json: bool = False
    """Print JSON instead of tables, with every episode."""

    def run(self) -> None:
        """Plays, then prints.

        Raises:
            UserError: A number that cannot be used, no such run, or no policy in it yet.
        """
        for name, low, high in (("episodes", 1, MOST_EPISODES), ("seed", 0, 2**31 - 1)):
            if not low <= getattr(self, name) <= high:
                value = getattr(self, name)
                raise UserError(f"--{name} {value} cannot be used: give {low} to {high}.")
        run = opened(self.path, self.policy, self.own_policy, self.own_environment)
        with told():
            played = run.play(which=self.policy, episodes=self.episodes, seed=self.seed)
        rows: list[dict[str, Any]] = played.to_pylist()
        by_seed = _by_seed(rows)

        from detpg.evaluation import summarise

        summary = summarise(list(by_seed.values()))
        if self.json:
            self._print_json(run.config, summary, rows)
        else:
            self._print_tables(run.config, summary, rows, by_seed)

    def _print_json(self, config: "Config", summary: "Summary", rows: list[dict[str, Any]]) -> None:
        found = {
            "run": str(self.path),
            "algorithm": config.algorithm,
            "environment": config.environment,
            "policy": self.policy,
            "seed": self.seed,
            "mean": _as_json(summary.mean),
            "iqm": _as_json(summary.iqm),
            "resampled": summary.over,
            "scores": summary.num_scores,
            "not_finite": summary.num_lost,
            "episodes": [{**row, "return": _finite(row["return"])} for row in rows],
        }
        print_json(found)

    def _print_tables(
        self,
        config: "Config",
        summary: "Summary",
        rows: list[dict[str, Any]],
        by_seed: "dict[int, np.ndarray]",
    ) -> None:
        from rich.console import Console
        from rich.markup import escape

        console = Console(highlight=False)
        who = f"{config.algorithm} in {config.environment}, its {self.policy} policy"
        console.print(escape(f"{who}, without noise"))
        shown = _Shown([row["return"] for row in rows])
        console.print(_summary_table(summary, shown))
        console.print(escape(_words(summary, len(rows))), style="dim")
        if summary.over == "runs":
            console.print(_seed_table(rows, by_seed, shown))
        if summary.over == "episodes" or self.episodes_table:
            console.print(_episode_table(rows, shown))


class _Shown:
    """Numbers with as many decimals as four figures of the largest need."""

    def __init__(self, values: list[float]):
        largest = max((abs(value) for value in values if math.isfinite(value)), default=0.0)
        self._decimals = max(0, min(6, 3 - math.floor(math.log10(largest)))) if largest else 0

    def __call__(self, value: float) -> str:
        return f"{value:,.{self._decimals}f}" if math.isfinite(value) else "not finite"


def _summary_table(summary: "Summary", shown: _Shown) -> Any:
    from rich.table import Table

    table = Table("return", title="what it earns", title_justify="left")
    table.add_column("estimate", justify="right")
    table.add_column("95% interval", justify="center")
    for name, found in (("mean", summary.mean), ("IQM", summary.iqm)):
        ends = f"{shown(float(found.low))} to {shown(float(found.high))}"
        known = math.isfinite(found.low)
        table.add_row(name, shown(float(found.value)), ends if known else "none")
    return table


def _words(summary: "Summary", num_episodes: int) -> str:
    """What was resampled, and what that leaves open."""
    kept = summary.num_scores - summary.num_lost
    if summary.over == "runs":
        each = num_episodes // summary.num_scores
        words = f"Over {kept} training seeds, each the mean of {each} episodes."
    else:
        words = (
            f"Over {kept} episodes of one training seed: what another seed would learn is not in "
            "the interval."
        )
    few = " With so few the interval is too narrow." if 1 < kept < FEW else ""
    what = "seeds" if summary.over == "runs" else "episodes"
    lost = f" Left out, not finite: {summary.num_lost} of the {what}." if summary.num_lost else ""
    return f"{words}{few}{lost}"


def _seed_table(rows: list[dict[str, Any]], by_seed: "dict[int, np.ndarray]", shown: _Shown) -> Any:
    import numpy as np
    from rich.table import Table

    from detpg.evaluation import iqm

    table = Table("seed", title="each training seed", title_justify="left")
    for name in ("mean", "IQM", "least", "greatest", "mean length"):
        table.add_column(name, justify="right")
    for seed, returns in by_seed.items():
        lengths = [row["length"] for row in rows if row["seed"] == seed]
        if not np.all(np.isfinite(returns)):
            returns = np.full_like(returns, np.nan)
        numbers = (returns.mean(), float(iqm(returns)), returns.min(), returns.max())
        table.add_row(str(seed), *map(shown, numbers), f"{sum(lengths) / len(lengths):,.1f}")
    return table


def _episode_table(rows: list[dict[str, Any]], shown: _Shown) -> Any:
    from rich.table import Table

    table = Table(title="each episode", title_justify="left")
    for name in ("seed", "episode", "return", "length"):
        table.add_column(name, justify="right")
    for row in rows:
        number = shown(row["return"])
        table.add_row(str(row["seed"]), str(row["episode"]), number, f"{row['length']:,}")
    return table


def _by_seed(rows: list[dict[str, Any]]) -> "dict[int, np.ndarray]":
    """The returns of each training seed's policy."""
    import numpy as np

    seeds = dict.fromkeys(row["seed"] for row in rows)
    return {
        seed: np.asarray([row["return"] for row in rows if row["seed"] == seed]) for seed in seeds
    }


def _as_json(found: "Estimate") -> dict[str, Any]:
    ends = [_finite(float(found.low)), _finite(float(found.high))]
    return {"value": _finite(float(found.value)), "interval": ends}


def _finite(value: float) -> float | None:
    """JSON knows no NaN."""
    return value if math.isfinite(value) else None
