"""A run in a directory: trained, kept at checkpoints, resumed where it stood."""

import contextlib
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from jaxtyping import PyTree

from detpg.integrations.tensorboard import Scalars
from detpg.runs import Checkpoints, RunDirectoryError, numbered, write_arrays
from detpg.types import Policy
from detpg.workbench.config import Config
from detpg.workbench.diagnosis import ended, warnings
from detpg.workbench.engines import engine_of
from detpg.workbench.failing import of_run
from detpg.workbench.folder import CHECKPOINTS, opened
from detpg.workbench.learners import learner
from detpg.workbench.opening import how_judged
from detpg.workbench.own import needs_own, own_policy
from detpg.workbench.session import Interval, Kept, Session
from detpg.workbench.sizes import told_of_memory
from detpg.workbench.tables import (
    EVALUATIONS,
    EVALUATIONS_SCHEMA,
    METRICS,
    METRICS_SCHEMA,
    evaluations_table,
    metrics_table,
    read_table,
    write_table,
)
from detpg.world_error import WorldError

TENSORBOARD = "tensorboard"
BEST, LAST = "best.npz", "last.npz"


class Progress(NamedTuple):
    """What is told after every interval.

    Attributes:
        step: Taken by each learner.
        steps: In all.
        rate: Environment steps a second of all learners together, since the start or resume.
        seconds_left: At that rate.
        returned: Mean return of the last evaluation, over learners that are not lost; None before
            the first.
        messages: New ones, in words: warnings, lost learners, damaged checkpoints.
    """

    step: int
    steps: int
    rate: float
    seconds_left: float
    returned: float | None
    messages: list[str]


class Stopped(NamedTuple):
    """How a run ended.

    Attributes:
        step: Where it stands.
        finished: Whether that is its end.
    """

    step: int
    finished: bool


def train_in(
    path: Path,
    config: Config,
    *,
    own: Policy | str | None = None,
    world: Any = None,
    started: Callable[[], None] = lambda: None,
    report: Callable[[Progress], None] = lambda progress: None,
    should_stop: Callable[[], bool] = lambda: False,
) -> Stopped:
    """Trains in a directory; goes on from its newest whole checkpoint if it holds this run.

    Args:
        path: The directory; made where it is missing.
        config: Of the run. Its steps may be more than those of an earlier session.
        own: The user's policy, or where it stands as FILE.py:NAME.
        world: The user's own, as `Trainer` takes it, instead of the one that is named.
        started: Called once all that was named is known to be there.
        report: Called after every interval.
        should_stop: Asked after every interval; a run that is stopped is checkpointed first.

    Raises:
        RunDirectoryError: The directory holds another run, is in use, or cannot be written to.
        DivergedError: No learner is finite any more.
        WorldError: The world raised, or returned what cannot be used.
        ValueError: What the configuration names does not exist or does not fit.
    """
    named = world is None and not (own is not None and not isinstance(own, str))
    with of_run(path, config, own if isinstance(own, str) else None, named):
        engine = engine_of(config, world)
        try:
            if ".py:" in config.policy and own is None:
                raise RunDirectoryError(needs_own(path, config))
            policy = own_policy(own, engine.spec) if isinstance(own, str) else own
            session = Session(config, engine, learner(config, engine.spec, policy))
            session.check_steps("steps", config.steps)
            with opened(path, config, engine.spec, engine.bounds):
                started()
                return _Recorder(path, session, report).train(should_stop)
        except OSError as error:
            raise RunDirectoryError(
                f"{path} cannot be written to ({error.strerror}): make room or choose another "
                "--output; the last checkpoint is untouched."
            ) from error
        finally:
            engine.close()


class _Recorder:
    """One session of a run, and all it writes."""

    def __init__(self, path: Path, session: Session, report: Callable[[Progress], None]):
        self._path, self._session, self._report = path, session, report
        config = session.config
        self._checkpoints = Checkpoints(path / CHECKPOINTS, config.keep_checkpoints)
        self._told: set[tuple[int, str]] = set()
        engine = session.engine
        self._messages = [] if engine.exact else [f"{engine.spec.name}: {engine.resume_note}."]
        self._messages += how_judged(config, is_compiled=engine.exact)
        self._messages += told_of_memory(config, session.learner.experience, engine.spec)
        self._returned: float | None = None
        until = self._resume()
        self._rows = read_table(path / METRICS, METRICS_SCHEMA, until).to_pylist()
        self._evaluations = read_table(path / EVALUATIONS, EVALUATIONS_SCHEMA, until)

    def _resume(self) -> int:
        """The step up to which what stands in the tables holds."""
        found = self._checkpoints.restore(self._session.kept)
        for name in self._checkpoints.damaged:
            self._messages.append(f"checkpoint {name} is damaged: the one before it is used.")
        if found is None:
            return -1
        step, kept = found
        self._session.resume(step, Kept(*kept))
        return step

    def train(self, should_stop: Callable[[], bool]) -> Stopped:
        """To the end, or until told to stop; if a world fails, what was learnt before is kept."""
        try:
            return self._train(should_stop)
        except WorldError:
            session, kept = self._session, self._checkpoints.steps
            learnt = session.step > max(kept, default=0)
            if learnt and len(session.lost()) < session.config.seeds:
                self._keep()
            raise

    def _train(self, should_stop: Callable[[], bool]) -> Stopped:
        session, config = self._session, self._session.config
        with contextlib.closing(
            Scalars(self._path / TENSORBOARD, config.seeds, session.step)
        ) as scalars:
            began, first = time.perf_counter(), session.step
            if self._unjudged():
                self._evaluated(Interval(session.step, [], session.evaluate([]), {}))
                if session.step:
                    self._keep()
            while session.step < config.steps:
                interval = session.advance(config.steps)
                stop = should_stop() and interval.step < config.steps
                rate = (interval.step - first) * config.seeds / (time.perf_counter() - began)
                self._record(interval, scalars, rate)
                ended = stop or interval.step == config.steps
                if ended or interval.step % config.checkpoint_every == 0:
                    scalars.flush()
                    self._keep()
                self._tell(interval, rate)
                if stop:
                    return Stopped(interval.step, finished=False)
        return Stopped(session.step, finished=True)

    def _unjudged(self) -> bool:
        """Whether the evaluation of the step at hand is missing: a world may have failed in it."""
        session, config = self._session, self._session.config
        due = session.step % config.evaluate_every == 0 or session.step == config.steps
        return due and session.step not in self._evaluations["step"].to_pylist()

    def _record(self, interval: Interval, scalars: Scalars, rate: float) -> None:
        self._rows += interval.rows
        for row in interval.rows:
            named = {name: value for name, value in row.items() if "/" in name}
            scalars.write(row["seed"], interval.step, {**named, "time/fps": rate})
        if interval.played is not None:
            self._evaluated(interval)
        self._diagnose(interval)

    def _evaluated(self, interval: Interval) -> None:
        if interval.played is not None:
            rows = evaluations_table(interval.played, interval.step)
            self._evaluations = pa.concat_tables([self._evaluations, rows])
            known = interval.played.returns[np.isfinite(interval.played.returns)]
            self._returned = float(known.mean()) if known.size else None

    def _diagnose(self, interval: Interval) -> None:
        config = self._session.config
        for seed, why in interval.lost.items():
            self._say(seed, "lost", f"lost, {why.words}.")
        if len(interval.lost) == config.seeds:
            good = self._checkpoints.steps
            kept = f"the last good checkpoint is {good[-1]}" if good else "no checkpoint is kept"
            raise ended(interval.lost, self._session.engine.bounds, kept)
        if not any("train/policy_change" in row for row in interval.rows):
            return  # nothing was judged
        for seed in set(range(config.seeds)) - set(interval.lost):
            own = [row for row in self._rows if row["seed"] == seed]
            for kind, words in warnings(own).items():
                self._say(seed, kind, words)

    def _say(self, seed: int, kind: str, words: str) -> None:
        """Each warning once for each seed."""
        if (seed, kind) not in self._told:
            self._told.add((seed, kind))
            self._messages.append(f"seed {seed}: {words}")

    def _keep(self) -> None:
        """Tables and policies first: what goes beyond the checkpoint is dropped on resuming."""
        session = self._session
        write_table(self._path / METRICS, metrics_table(self._rows))
        write_table(self._path / EVALUATIONS, self._evaluations)
        write_policy(self._path / BEST, session.kept.best, session.kept.best_return)
        write_policy(self._path / LAST, session.learners, session.kept.best_return)
        self._checkpoints.save(session.step, session.kept)

    def _tell(self, interval: Interval, rate: float) -> None:
        config, messages = self._session.config, self._messages
        self._messages = []
        left = (config.steps - interval.step) * config.seeds / rate
        told = Progress(interval.step, config.steps, rate, left, self._returned, messages)
        self._report(told)


def write_policy(path: Path, learners: PyTree, best_return: Any) -> None:
    """States of the learners, leaves by number, seeds first."""
    write_arrays(path, {"best_return": np.asarray(best_return), **numbered(learners)})
