"""Runs a study into a directory: sweep, selection, fresh runs, tables, claims, summary."""

import dataclasses
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from detpg.executors import InProcess, Processes
from detpg.experiments.report import claims_page
from detpg.experiments.selection import Selection, score, select
from detpg.experiments.study import Arm, Condition, Phase, Results, Study
from detpg.experiments.sweep import join, plan, run_shard
from detpg.runs import RunDirectory, TableWriter, provenance, write_atomically

Progress = Callable[[str, int, int], None]
Cells = dict[tuple[Condition, str], np.ndarray]


@dataclasses.dataclass(frozen=True)
class Reproduction:
    """One study at one preset and seed, in one directory.

    Attributes:
        study: What is run.
        preset: Name of one of its presets.
        seed: Of everything random.
        workers: Processes; the results do not depend on it.
        directory: Where it stands.
        progress: Called with a phase's name, shards done and shards in all.
    """

    study: Study
    preset: str
    seed: int
    workers: int
    directory: RunDirectory
    progress: Progress

    def run(self) -> None:
        """Runs what is missing, then writes the tables and, last, the summary."""
        began = time.monotonic()
        thin = self.study.presets[self.preset].thin
        cells = list(self._cells())
        grids = {arm.name: arm.points(thin) for _, arm in cells}

        executor = InProcess(run_shard) if self.workers == 1 else Processes(run_shard, self.workers)
        with executor:
            sweep = self._phase(executor, "sweep", {(c, arm): grids[arm.name] for c, arm in cells})
            selections = {
                (c, arm.name): select(
                    sweep[c, arm.name], grids[arm.name], self.study.rules, arm.profile
                )
                for c, arm in cells
            }
            chosen = {
                (c, arm): _take(grids[arm.name], selections[c, arm.name].indices)
                for c, arm in cells
            }
            costs: dict[tuple[Condition, str, Phase], np.ndarray] = {}
            for phase in ("fresh", "interval"):
                done = self._phase(executor, phase, chosen)
                costs |= {(c, name, phase): values for (c, name), values in done.items()}

        results = Results(self.study, selections, costs, grids, self.seed)
        self._write_tables(sweep, results)
        self._write_report(results, time.monotonic() - began)

    def _phase(
        self,
        executor: InProcess | Processes,
        phase: Phase,
        points: dict[tuple[Condition, Arm], dict[str, np.ndarray]],
    ) -> Cells:
        """Metric (points, seeds, time) of every cell, from finished shards where they exist."""
        scale = self.study.presets[self.preset]
        num_seeds = scale.num_seeds(phase)
        if num_seeds == 0:
            return {}
        plans = {
            (condition, arm.name): plan(
                condition,
                arm,
                phase,
                grid,
                num_seeds,
                shape=scale.shard,
                study_seed=self.seed,
                steps=self.study.steps,
                record_every=self.study.record_every,
            )
            for (condition, arm), grid in points.items()
        }
        shards = [shard for cell in plans.values() for shard in cell]
        found = {shard.name: self.directory.shard(shard.name) for shard in shards}
        missing = [shard for shard in shards if found[shard.name] is None]
        self.progress(phase, len(shards) - len(missing), len(shards))
        groups = [shard.program for shard in missing]
        for done, (index, result) in enumerate(executor.run(missing, groups), 1):
            found[missing[index].name] = result
            self.directory.save_shard(missing[index].name, result)
            self.progress(phase, len(shards) - len(missing) + done, len(shards))
        return {
            cell: join(members, [_present(found[shard.name]) for shard in members])
            for cell, members in plans.items()
        }

    def _write_tables(self, sweep: Cells, results: Results) -> None:
        path = self.directory.path
        with TableWriter(path / "sweep.parquet", _schema(self.study)) as table:
            for condition, arm in self._cells():
                values = sweep[condition, arm.name]
                self._block(table, condition, arm, "sweep", values, results, None)
        with TableWriter(path / "curves.parquet", _schema(self.study, role=True)) as table:
            for (condition, name, phase), values in results.costs.items():
                arm = next(a for a in self.study.arms if a.name == name)
                selection = results.selections[condition, name]
                self._block(table, condition, arm, phase, values, results, selection)

    def _cells(self) -> Iterator[tuple[Condition, Arm]]:
        arms = self.study.arms_of(self.preset)
        return ((condition, arm) for condition in self.study.conditions for arm in arms)

    def _block(
        self,
        table: TableWriter,
        condition: Condition,
        arm: Arm,
        phase: Phase,
        values: np.ndarray,
        results: Results,
        selection: Selection | None,
    ) -> None:
        """Rows of one cell; of the chosen points only where there is a selection."""
        grid = results.points[arm.name]
        num_points = len(next(iter(grid.values())))
        indices = range(num_points) if selection is None else selection.indices
        axes: dict[str, Any] = {
            "study": self.study.name,
            **dict(condition.options),
            "arm": arm.name,
            "algorithm": arm.algorithm,
            "phase": phase,
            "point": (0, list(indices)),
            "seed": (1, list(range(values.shape[1]))),
            "step": (2, self.study.times.tolist()),
        }
        for name in _hyper_names(self.study):
            axes[name] = (
                0,
                _take(grid, indices)[name].tolist() if name in grid else _nothing(indices),
            )
        if selection is not None:
            axes["role"] = (0, [choice.role for choice in selection.choices])
        table.block(axes, {"cost": values, "finite": np.isfinite(values)})

    def _write_report(self, results: Results, seconds: float) -> None:
        scale = self.study.presets[self.preset]
        claims = self.study.judge(results)
        summary = {
            "figure": self.study.name,
            "preset": self.preset,
            "seed": self.seed,
            "environment_steps": self.study.steps * _num_runs(results, scale.sweep_seeds),
            "wall_seconds": round(seconds, 1),
            "selected": [row for cell in self._cells() for row in _selected(results, *cell)],
            "claims": [claim.as_json() for claim in claims],
            "provenance": provenance(self.directory.config),
        }
        page = claims_page(self.study, self.preset, self.seed, summary["selected"], claims)
        path = self.directory.path / "claims.md"
        write_atomically(path, lambda file: file.write(page.encode()))
        self.directory.finish(summary)


def _take(grid: dict[str, np.ndarray], indices: Any) -> dict[str, np.ndarray]:
    return {name: values[list(indices)] for name, values in grid.items()}


def _nothing(indices: Any) -> list[float | None]:
    return [None for _ in indices]


def _present(result: np.ndarray | None) -> np.ndarray:
    assert result is not None, "every shard was found or run"
    return result


def _hyper_names(study: Study) -> list[str]:
    return sorted({name for arm in study.arms for name, _ in arm.grid})


def _num_runs(results: Results, sweep_seeds: int) -> int:
    """Runs of all phases."""
    points = sum(len(next(iter(grid.values()))) for grid in results.points.values())
    fresh = sum(values.shape[0] * values.shape[1] for values in results.costs.values())
    return len(results.study.conditions) * points * sweep_seeds + fresh


def _selected(results: Results, condition: Condition, arm: Arm) -> Iterator[dict[str, Any]]:
    """The best points of a cell with both their numbers: on the sweep seeds and on fresh ones."""
    selection = results.selections[condition, arm.name]
    for rule in results.study.rules:
        best = selection.choices[selection.row(rule)]
        fresh = score(results.runs(condition, arm.name, rule), rule)
        point = {
            name: float(values[best.index]) for name, values in results.points[arm.name].items()
        }
        yield {
            **dict(condition.options),
            "arm": arm.name,
            "chosen_by": rule,
            "point": point,
            "on_edge": list(best.edges),
            "sweep_score": _number(best.score),
            "fresh_score": _number(float(fresh.mean())),
            "sweep_runs": selection.num_runs,
            "sweep_runs_diverged": selection.num_diverged,
            "fresh_runs": fresh.size,
            "fresh_runs_diverged": int(np.sum(~np.isfinite(fresh))),
        }


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _schema(study: Study, role: bool = False) -> pa.Schema:
    kinds: dict[str, pa.DataType] = {"study": pa.string()}
    for name, value in study.conditions[0].options:
        kinds[name] = pa.int32() if isinstance(value, int) else pa.string()
    kinds |= dict.fromkeys(("arm", "algorithm", "phase"), pa.string())
    kinds |= {"role": pa.string()} if role else {}
    kinds |= {"point": pa.int32()}
    kinds |= dict.fromkeys(_hyper_names(study), pa.float64())
    kinds |= {"seed": pa.int32(), "step": pa.int32(), "cost": pa.float32(), "finite": pa.bool_()}
    return pa.schema(list(kinds.items()))


def run_directory(study: Study, preset: str, seed: int, output: Path) -> RunDirectory:
    """The directory of a study under an output folder; nothing is touched."""
    return RunDirectory(output / study.name, study.config(preset, seed))
