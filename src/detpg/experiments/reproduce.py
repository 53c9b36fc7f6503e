"""Runs a study into a directory: sweep, selection, fresh runs, tables, claims, summary."""

import contextlib
import dataclasses
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from detpg.executors import InProcess, Processes
from detpg.experiments.report import claims_page
from detpg.experiments.selection import committed, score, select
from detpg.experiments.study import Arm, Condition, Phase, Results, Study
from detpg.experiments.sweep import Shard, join, plan
from detpg.experiments.tables import Cells, write_tables
from detpg.runs import RunDirectory, provenance, write_atomically

Grid = dict[str, np.ndarray]


def run_directory(study: Study, preset: str, seed: int, output: Path) -> RunDirectory:
    """The directory of a study under an output folder; nothing is touched."""
    return RunDirectory(output / study.name, study.config(preset, seed))


@dataclasses.dataclass(frozen=True)
class Reproduction:
    """One study at one preset and seed, in one directory.

    Attributes:
        study: What is run.
        preset: Name of one of its presets.
        seed: Of everything random.
        workers: Processes; the results do not depend on it.
        directory: Where it stands, opened.
        progress: Called with a phase's name, environment steps done, those in all, and how many
            are done a second.
    """

    study: Study
    preset: str
    seed: int
    workers: int
    directory: RunDirectory
    progress: Callable[[str, int, int, float], None]

    def run(self) -> None:
        """Runs what is missing, then writes the tables and, last, the summary."""
        cells = [(c, arm) for c in self.study.conditions for arm in self.study.arms_of(self.preset)]
        scale = self.study.presets[self.preset]
        grids = {arm.name: scale.grid(arm) for _, arm in cells}
        judged = self.study.lost_above, self.study.num_final
        run = self.study.run_shard
        executor = InProcess(run) if self.workers == 1 else Processes(run, self.workers)
        with executor:
            every = {(c, arm): grids[arm.name] for c, arm in cells}
            sweep, _ = self._phase(executor, "sweep", every)
            selections = {
                (c, arm.name): committed(self.study.rules)
                if scale.committed
                else select(
                    sweep[c, arm.name], grids[arm.name], self.study.rules, arm.profile, *judged
                )
                for c, arm in cells
            }
            chosen = {
                (c, arm): _take(grids[arm.name], selections[c, arm.name].indices)
                for c, arm in cells
            }
            costs: dict[tuple[Condition, str, Phase], np.ndarray] = {}
            extras: dict[tuple[Condition, str, Phase], dict[str, np.ndarray]] = {}
            for phase in ("fresh", "interval"):
                done, beside = self._phase(executor, phase, chosen)
                costs |= {(c, name, phase): values for (c, name), values in done.items()}
                extras |= {(c, name, phase): values for (c, name), values in beside.items()}
        results = Results(self.study, selections, costs, extras, grids, self.seed)
        if self.study.keep is not None:
            fresh = [s for cell in self._plans("fresh", chosen).values() for s in cell]
            self.study.keep(results, fresh, self.directory.path)
        write_tables(results, sweep, self.directory.path)
        cells_run = [*sweep.items(), *((key[:2], values) for key, values in costs.items())]
        self._write_report(
            results,
            sum(condition.steps * v.shape[0] * v.shape[1] for (condition, _), v in cells_run),
        )

    def _phase(
        self,
        executor: InProcess | Processes,
        phase: Phase,
        points: dict[tuple[Condition, Arm], Grid],
    ) -> tuple[Cells, dict[tuple[Condition, str], dict[str, np.ndarray]]]:
        """Cost (points, seeds, time) of every cell, and the further measures.

        From finished shards where they exist.
        """
        plans = self._plans(phase, points)
        shards = [shard for cell in plans.values() for shard in cell]
        found = self._complete(executor, phase, shards)
        joined = {
            cell: join(members, [found[shard.name] for shard in members])
            for cell, members in plans.items()
            if members
        }
        further = self.study.further
        if not further:
            return joined, {cell: {} for cell in joined}
        extras = {
            cell: {name: values[..., 1 + i] for i, name in enumerate(further)}
            for cell, values in joined.items()
        }
        return {cell: values[..., 0] for cell, values in joined.items()}, extras

    def _plans(
        self, phase: Phase, points: dict[tuple[Condition, Arm], Grid]
    ) -> dict[tuple[Condition, str], list[Shard]]:
        """The shards of every cell."""
        scale = self.study.presets[self.preset]
        return {
            (condition, arm.name): plan(
                condition,
                arm,
                phase,
                grid,
                scale.num_seeds(phase),
                shape=scale.shard,
                study_seed=self.seed,
                folder=str(self.directory.shards),
            )
            for (condition, arm), grid in points.items()
        }

    def _complete(
        self, executor: InProcess | Processes, phase: Phase, shards: list[Shard]
    ) -> dict[str, np.ndarray]:
        """Results of all shards by name; those that were not found are run and kept."""
        results = {shard.name: self.directory.shard(shard.name) for shard in shards}
        found = {name: result for name, result in results.items() if result is not None}
        missing = [shard for shard in shards if shard.name not in found]
        earlier, began = self.directory.seconds, time.monotonic()
        total = sum(shard.steps for shard in shards)
        at_first = total - sum(shard.steps - shard.steps_kept() for shard in missing)

        def tell() -> None:
            waiting = [shard for shard in missing if shard.name not in found]
            done = total - sum(shard.steps - shard.steps_kept() for shard in waiting)
            self.progress(phase, done, total, (done - at_first) / (time.monotonic() - began))

        if not shards:
            return found
        tell()
        with _every_second(tell):
            for index, result in executor.run(missing, [shard.program for shard in missing]):
                self.directory.save_shard(missing[index].name, result)
                self.directory.seconds = earlier + time.monotonic() - began
                found[missing[index].name] = result
                tell()
        return found

    def _write_report(self, results: Results, environment_steps: int) -> None:
        claims = self.study.judge(results)
        selected = [row for cell in results.selections for row in _selected(results, *cell)]
        page = claims_page(self.study, self.preset, self.seed, selected, claims)
        path = self.directory.path / "claims.md"
        write_atomically(path, lambda file: file.write(page.encode()))
        self.directory.finish(
            {
                "figure": self.study.name,
                "preset": self.preset,
                "seed": self.seed,
                "environment_steps": environment_steps,
                "wall_seconds": round(self.directory.seconds, 1),
                "selected": selected,
                "claims": [claim.as_json() for claim in claims],
                "provenance": provenance(self.directory.config),
            }
        )


@contextlib.contextmanager
def _every_second(tell: Callable[[], None]) -> Iterator[None]:
    """Calls a function from time to time while workers are waited for."""
    finished = threading.Event()

    def loop() -> None:
        while not finished.wait(1.0):
            tell()

    thread = threading.Thread(target=loop, daemon=True)
    thread.start()
    try:
        yield
    finally:
        finished.set()
        thread.join()


def _take(grid: Grid, indices: list[int]) -> Grid:
    return {name: values[indices] for name, values in grid.items()}


def _selected(results: Results, condition: Condition, arm: str) -> Iterator[dict[str, Any]]:
    """The best points of a cell with both their numbers: on the sweep seeds and on fresh ones."""
    selection = results.selections[condition, arm]
    for rule in results.study.rules:
        best = selection.choices[selection.row(rule)]
        runs, study = results.runs(condition, arm, rule), results.study
        fresh = score(runs, rule, study.lost_above, study.num_final)
        kept = fresh[np.isfinite(fresh)]
        sign = -1.0 if study.measured == "return" else 1.0
        grid = results.points[arm]
        yield {
            **dict(condition.columns),
            "arm": arm,
            "chosen_by": rule,
            "point": {name: float(values[best.index]) for name, values in grid.items()},
            "on_edge": list(best.edges),
            "sweep_score": _number(sign * best.score),
            "fresh_score": sign * float(kept.mean()) if kept.size else None,
            "sweep_runs": selection.num_runs,
            "sweep_runs_diverged": selection.num_diverged,
            "fresh_runs": fresh.size,
            "fresh_runs_diverged": fresh.size - kept.size,
        }


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None
