"""A run in memory: advanced interval by interval, watched, judged."""

import dataclasses
from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from detpg.types import Algorithm, Bounds, EnvironmentSpec
from detpg.workbench.config import Config
from detpg.workbench.diagnosis import Fault, faults
from detpg.workbench.lanes import grown
from detpg.workbench.play import Played, bias, finite_seeds
from detpg.workbench.tables import read_meter
from detpg.world_error import WorldError
from detpg.wrappers import Controller, Metered


class Engine(Protocol):
    """What drives the learners of a run: a compiled world, a host's, or logged data.

    A state is a tree of arrays, seeds first; `exact` says whether a resumed run equals one that was
    never stopped, `resume_note` says it in words. `play` gives None where there is no world.
    """

    exact: bool
    resume_note: str

    @property
    def spec(self) -> EnvironmentSpec: ...

    @property
    def bounds(self) -> Bounds: ...

    def use(self, learner: Algorithm) -> None: ...

    def begin(self) -> Any: ...

    def resume(self, state: Any, step: int) -> Any: ...

    def advance(self, state: Any, steps: int) -> Any: ...

    def learners(self, state: Any) -> PyTree: ...

    def metered(self, state: Any) -> PyTree: ...

    def with_learners(self, state: Any, learners: PyTree) -> Any: ...

    def play(self, learners: PyTree, episodes: int, seed: int) -> Played | None: ...

    def close(self) -> None: ...


class Kept(NamedTuple):
    """All that a checkpoint holds.

    Attributes:
        state: Of the engine.
        best: States of the learners at their best evaluations.
        best_return: Mean return there, of each learner.
        judged: States of the learners at the last evaluation.
    """

    state: Any
    best: PyTree
    best_return: Any
    judged: PyTree


class Interval(NamedTuple):
    """What was seen between two rows of metrics.

    Attributes:
        step: At its end.
        rows: Of metrics, one for each seed; none if the interval ended early.
        played: The evaluation at its end, if there was one.
        lost: Seed -> why, of learners that are no longer finite.
    """

    step: int
    rows: list[dict[str, Any]]
    played: Played | None
    lost: dict[int, Fault]


class Session:
    """Learners of one configuration on one engine.

    Attributes:
        config: Of the run.
        engine: What drives them.
        learner: The learner, normalised and metered.
        step: Taken so far, by each learner.
        kept: What a checkpoint holds.
    """

    def __init__(self, config: Config, engine: Engine, learner: Algorithm):
        """Before the first step."""
        self.config, self.engine, self.learner = config, engine, learner
        self.check_steps("log_every", config.log_every)
        engine.use(learner)
        state = engine.begin()
        learners = engine.learners(state)
        self.kept = Kept(state, learners, jnp.full(config.seeds, -jnp.inf), learners)
        self.step = 0

    def check_steps(self, name: str, steps: int) -> None:
        """Refuses a number of steps at whose end an update would stand half done.

        Raises:
            ValueError: Says of what it must be a multiple.
        """
        taken = self.learner.experience
        unit = taken.batch if taken.kind == "fresh" else self.config.num_envs
        if steps % unit:
            raise ValueError(
                f"{name} = {steps} is no multiple of {unit}, the steps that the learner takes at "
                "once: give one that is."
            )

    def reserve(self, steps: int) -> None:
        """Makes room in the memories for as many steps in all, up to what the learner holds."""
        taken = self.learner.experience
        if taken.kind == "recalled":
            self.kept = self.kept._replace(state=grown(self.kept.state, min(taken.capacity, steps)))

    def resume(self, step: int, kept: Kept) -> None:
        """Goes on from a checkpoint."""
        self.step = step
        self.kept = kept._replace(state=self.engine.resume(kept.state, step))

    def advance(self, until: int) -> Interval:
        """To the next row of metrics, or to the end."""
        every = self.config.log_every
        target = min(until, (self.step // every + 1) * every)
        try:
            state = self.engine.advance(self.kept.state, target - self.step)
        except WorldError as error:
            if error.reached is not None:  # what was learnt in part of the interval
                state, taken = error.reached
                self.kept, self.step = self.kept._replace(state=state), self.step + taken
            raise
        except BaseException:
            if (reached := getattr(self.engine, "reached", None)) is not None:
                self.kept = self.kept._replace(state=reached[0])
                self.step += reached[1]
            raise
        self.kept = unread = self.kept._replace(state=state)
        self.step = target
        rows = self._read() if target % every == 0 else []
        lost = self.lost()
        due = target % self.config.evaluate_every == 0 or target == until
        try:
            played = self.evaluate(rows) if due and len(lost) < self.config.seeds else None
        except WorldError:
            self.kept = unread  # the rows are lost with the evaluation, what they tell is not
            raise
        return Interval(target, rows, played, lost)

    def evaluate(self, rows: list[dict[str, Any]]) -> Played | None:
        """Plays the mean policies; what that tells is added to the rows of metrics."""
        learners, episodes = self.learners, self.config.evaluation_episodes
        played = self.engine.play(learners, episodes, self.config.seed) if episodes else None
        changes = self._changes(learners)
        for row, change in zip(rows, changes):
            row["train/policy_change"] = float(change)
        self.kept = self.kept._replace(judged=learners)
        if played is None:  # nothing judges: the last is the best that is known
            self.kept = self.kept._replace(best=learners)
            return None
        critic, returns = bias(played), played.returns.mean(axis=1)
        for i, row in enumerate(rows):
            row["eval/mean_reward"] = float(returns[i])
            row["eval/mean_ep_length"] = float(played.lengths[i].mean())
            if isinstance(self.learner, Metered):
                row["eval/value_bias"] = float(critic.mean[i])
                row["eval/value_scale"] = float(critic.scale[i])
        self._keep_best(learners, jnp.asarray(returns))
        return played

    @property
    def learners(self) -> PyTree:
        """States of the learners, seeds first."""
        return self.engine.learners(self.kept.state)

    def controller(self, learners: PyTree, index: int) -> Controller:
        """What is deployed, of one of them."""
        state = jax.tree.map(lambda leaf: leaf[index], learners)
        return controller(self.learner, state, self.engine.bounds)

    def _read(self) -> list[dict[str, Any]]:
        """Rows of metrics, and the meter starts anew."""
        if not isinstance(self.learner, Metered):
            return [{"seed": i, "step": self.step} for i in range(self.config.seeds)]
        learners = self.engine.metered(self.kept.state)
        rows = read_meter(learners.meter, acted=self.config.data is None)
        fresh = dataclasses.replace(learners, meter=learners.meter.read())
        state = self.engine.with_learners(self.kept.state, fresh)
        self.kept = self.kept._replace(state=state)
        return [{"seed": i, "step": self.step, **row} for i, row in enumerate(rows)]

    def lost(self) -> dict[int, Fault]:
        """Why each learner that is no longer finite is not."""
        learners = self.engine.metered(self.kept.state)
        finite = finite_seeds(learners, self.config.seeds)
        if isinstance(self.learner, Metered):
            return faults(learners.meter, finite)
        why = Fault(f"a parameter is not finite at step {self.step}", by_world=False)
        return {int(i): why for i in np.flatnonzero(~finite)}

    def _changes(self, learners: PyTree) -> np.ndarray:
        """Relative change of each policy's parameters since the last evaluation."""
        now, before = (_flat(policy_parameters(x)) for x in (learners, self.kept.judged))
        size = np.maximum(np.linalg.norm(now, axis=1), np.linalg.norm(before, axis=1))
        return np.linalg.norm(now - before, axis=1) / np.maximum(size, 1e-12)

    def _keep_best(self, learners: PyTree, returns: Any) -> None:
        better = returns > self.kept.best_return

        def chosen(new: Any, old: Any) -> Any:
            return jnp.where(jnp.reshape(better, (-1,) + (1,) * (new.ndim - 1)), new, old)

        best = jax.tree.map(chosen, learners, self.kept.best)
        best_return = jnp.where(better, returns, self.kept.best_return)
        self.kept = self.kept._replace(best=best, best_return=best_return)


def controller(learner: Any, state: Any, bounds: Bounds) -> Controller:
    """What is deployed of a learner: without the meter."""
    if isinstance(learner, Metered):
        return Controller(learner.algorithm, state.learner, bounds)
    return Controller(learner, state, bounds)


def policy_parameters(state: Any) -> PyTree:
    """Theta, or what a stochastic learner has in its place, inside the wrappers' states."""
    while hasattr(state, "learner"):
        state = state.learner
    return next(getattr(state, n) for n in ("theta", "u", "parameters") if hasattr(state, n))


def _flat(tree: PyTree) -> np.ndarray:
    leaves = [np.asarray(leaf, float) for leaf in jax.tree.leaves(tree)]
    return np.concatenate([leaf.reshape(len(leaf), -1) for leaf in leaves], axis=1)
