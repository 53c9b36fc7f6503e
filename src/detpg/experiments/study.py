"""A study as data: what is run, over which grids, how the best point is chosen, what is claimed."""

import dataclasses
import itertools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import numpy as np

from detpg.experiments.claims import Claim
from detpg.experiments.selection import Rule, Selection

Options = tuple[tuple[str, Any], ...]
Phase = Literal["sweep", "fresh", "interval"]


@dataclasses.dataclass(frozen=True)
class Condition:
    """One problem of a study.

    Attributes:
        environment: Registry name.
        options: Static options of the environment.
        times: Environment steps at which the metric is recorded, in order; a run ends at the last.
    """

    environment: str
    options: Options
    times: tuple[int, ...]

    @property
    def columns(self) -> Options:
        """What tells it from the study's other problems, for tables."""
        return self.options or (("task", self.environment),)

    @property
    def label(self) -> str:
        """For file names and progress: m-10-spectrum-mixed."""
        return "-".join(f"{name}-{value}" for name, value in self.columns)

    @property
    def steps(self) -> int:
        """Environment steps of a run."""
        return self.times[-1]


@dataclasses.dataclass(frozen=True)
class Arm:
    """One learner of a study: a registered algorithm, its static options and its grid.

    Attributes:
        name: For tables and legends; also part of file names.
        algorithm: Registry name.
        options: Static options of the algorithm.
        grid: Hyper-parameter -> values; a point is one of each.
        profile: A hyper-parameter at each value of which the best points are also kept.
        ties: (hyper-parameter, another one of the grid whose value it takes).
        committed: The point that a finished sweep chose, for presets without a sweep.
    """

    name: str
    algorithm: str
    options: Options
    grid: tuple[tuple[str, tuple[float, ...]], ...]
    profile: str | None = None
    ties: tuple[tuple[str, str], ...] = ()
    committed: tuple[tuple[str, float], ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The hyper-parameters that a point sets."""
        return (*(name for name, _ in self.grid), *(name for name, _ in self.ties))

    def points(self, thin: Options = ()) -> dict[str, np.ndarray]:
        """All points of the grid, one array per hyper-parameter, the last one fastest.

        Args:
            thin: (hyper-parameter, k): keep every k-th value of that axis.
        """
        strides = dict(thin)
        axes = [values[:: strides.get(name, 1)] for name, values in self.grid]
        points = np.array(list(itertools.product(*axes)), dtype=np.float64)
        columns = {name: points[:, i] for i, (name, _) in enumerate(self.grid)}
        return columns | {name: columns[source] for name, source in self.ties}


@dataclasses.dataclass(frozen=True)
class Preset:
    """How much of a study is run.

    Attributes:
        thin: (hyper-parameter, k): keep every k-th value of that grid axis.
        sweep_seeds: Seeds on which the best point is chosen.
        fresh_seeds: Runs of the figure, on seeds that selection never saw.
        interval_seeds: Further fresh runs, for intervals (0: the figure's runs serve).
        shard: Points and seeds side by side in one shard.
        without: Names of learners that are left out.
        committed: No sweep: the learners' committed points are run.
        recordings: After how many recordings a run stops; None: at its end.
    """

    thin: Options
    sweep_seeds: int
    fresh_seeds: int
    interval_seeds: int
    shard: tuple[int, int]
    without: tuple[str, ...] = ()
    committed: bool = False
    recordings: int | None = None

    def grid(self, arm: Arm) -> dict[str, np.ndarray]:
        """The points of a learner that are run."""
        if self.committed:
            return {name: np.array([value]) for name, value in arm.committed}
        return arm.points(self.thin)

    def num_seeds(self, phase: Phase) -> int:
        return {
            "sweep": self.sweep_seeds,
            "fresh": self.fresh_seeds,
            "interval": self.interval_seeds,
        }[phase]


@dataclasses.dataclass(frozen=True)
class Results:
    """What a finished study measured.

    Attributes:
        study: The study.
        selections: (condition, arm name) -> the chosen points and their sweep scores.
        costs: (condition, arm name, phase) -> cost of shape (selected, seeds, time).
        extras: (condition, arm name, phase) -> the study's further measures, by name.
        points: Arm name -> its grid points.
        seed: The study's seed.
    """

    study: "Study"
    selections: dict[tuple[Condition, str], Selection]
    costs: dict[tuple[Condition, str, Phase], np.ndarray]
    extras: dict[tuple[Condition, str, Phase], dict[str, np.ndarray]]
    points: dict[str, dict[str, np.ndarray]]
    seed: int

    def runs(self, condition: Condition, arm: str, role: str) -> np.ndarray:
        """Cost of shape (runs, time) of a chosen point: the interval runs where there are any."""
        row = self.selections[condition, arm].row(role)
        return self.costs[condition, arm, self._phase(condition, arm)][row]

    def extra(self, condition: Condition, arm: str, role: str, name: str) -> np.ndarray:
        """A further measure of the same runs, shape (runs, time)."""
        row = self.selections[condition, arm].row(role)
        return self.extras[condition, arm, self._phase(condition, arm)][name][row]

    def _phase(self, condition: Condition, arm: str) -> Phase:
        return "interval" if (condition, arm, "interval") in self.costs else "fresh"


@dataclasses.dataclass(frozen=True)
class Study:
    """A figure of the paper as data.

    Attributes:
        name: What `detpg reproduce` calls it.
        title: One line for people.
        section: Where the paper describes it.
        claim: What the paper claims, in our words.
        conditions: The problems.
        arms: The learners.
        metric: What is recorded, in words, with its unit.
        measured: "cost" or "steps", lower is better, or "return", whose negative is the cost
            everywhere but in tables and pictures.
        further: Names of what is recorded beside it.
        keep: Called at the end with the results, the shards of the fresh runs, whose checkpoints
            are still there, and the run directory: writes what is to be kept of them.
        lost_above: A cost that no run starts with: one that ends above it has diverged. None: only
            a run that is not finite has.
        num_final: Recordings whose mean is the final cost.
        rules: What "best performing" may mean: each picks its own points.
        verdicts: How the claims are judged, for the head of the report.
        presets: Name -> how much is run.
        run_shard: What a worker does: from a Shard to costs of shape (points, seeds, time), or
            with a last axis for the cost and the further measures where there are any.
        judge: From results to claims.
    """

    name: str
    title: str
    section: str
    claim: str
    conditions: tuple[Condition, ...]
    arms: tuple[Arm, ...]
    metric: str
    measured: Literal["cost", "return", "steps"]
    lost_above: float | None
    num_final: int
    rules: tuple[Rule, ...]
    verdicts: str
    presets: dict[str, Preset]
    run_shard: Callable[[Any], np.ndarray]
    judge: Callable[[Results], list[Claim]]
    further: tuple[str, ...] = ()
    keep: Callable[[Results, list[Any], Path], None] | None = None

    def at(self, preset: str) -> "Study":
        """The study as a preset runs it: some stop early."""
        stop = self.presets[preset].recordings
        shorter = (dataclasses.replace(c, times=c.times[:stop]) for c in self.conditions)
        return dataclasses.replace(self, conditions=tuple(shorter))

    def arms_of(self, preset: str) -> tuple[Arm, ...]:
        """The learners that a preset runs."""
        return tuple(arm for arm in self.arms if arm.name not in self.presets[preset].without)

    def config(self, preset: str, seed: int) -> dict[str, Any]:
        """Everything that decides the study's numbers, as JSON types."""
        parts = {
            field.name: getattr(self, field.name)
            for field in dataclasses.fields(self)
            if field.name not in ("judge", "run_shard", "presets", "verdicts", "keep")
        }
        resolved = {**parts, "preset": preset, "scale": self.presets[preset], "seed": seed}
        return json.loads(json.dumps(resolved, default=dataclasses.asdict))
