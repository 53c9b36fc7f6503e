"""Worlds in which policies are judged: they end, and what they return wrongly is told."""

import warnings
from typing import Any

import numpy as np

from detpg.integrations.gymnasium.hosted import NO_TIME_LIMIT, Step
from detpg.world_error import WorldError

LONGEST = 10_000  # steps after which an episode is cut where no time limit is known


class Judged:
    """`Worlds` for one evaluation, with these differences.

    An episode is cut at the time limit, or where none is known after `LONGEST` steps
    (docs/decisions/0032). One in which a world returns what is not finite has no return: NaN.

    Attributes:
        num: How many.
    """

    def __init__(self, worlds: Any, new: bool):
        """Takes worlds for an evaluation.

        Args:
            worlds: `integrations.gymnasium.worlds.Worlds`.
            new: Whether no policy of this run was judged yet: then a world without an end is
                refused.
        """
        self.num, self._worlds, self._new = worlds.num, worlds, new
        self._name, known = worlds.spec.name, worlds.spec.time_limit
        self._limit_known = known != NO_TIME_LIMIT
        self._limit = known if self._limit_known else LONGEST
        self._length = np.zeros(self.num, int)
        self._spoilt = np.zeros(self.num, bool)  # the episode at hand
        self._told = False

    def reset(self, seeds: list[int]) -> np.ndarray:
        """New episodes in all worlds."""
        try:
            observation = self._worlds.reset(seeds)
        except WorldError as error:
            error.when = "at the start of an evaluation"
            raise
        self._spoilt = ~np.isfinite(observation).all(axis=1)
        self._tell(self._spoilt, None, observation)
        return observation

    def step(self, actions: Any) -> Step:
        """One step of each world.

        Raises:
            ValueError: An episode does not end, and cannot or should not be cut.
        """
        try:
            step = self._worlds.step(actions)
        except WorldError as error:
            i = int(np.argmax(self._length)) if error.index is None else error.index
            error.when = self._when(i, int(self._length[i]) + 1)
            raise
        self._length += step.valid
        step = self._cut(step)
        over, valid = step.terminated | step.truncated, step.valid
        # Where an episode has terminated, nobody looks at the last observation.
        seen = np.where(step.terminated[:, None], 0, step.next_observation)
        wrong = ~(np.isfinite(step.reward) & np.isfinite(seen).all(axis=1)) & valid
        self._tell(wrong, step.reward, seen)
        self._spoilt |= wrong
        reward = np.where(self._spoilt, np.nan, step.reward)
        self._length[over] = 0
        self._spoilt &= ~over
        begun = ~valid if step.observation is step.next_observation else over | ~valid
        if begun.any():
            wrong = begun & ~np.isfinite(step.observation).all(axis=1)
            self._tell(wrong, None, step.observation)
            self._spoilt |= wrong
        return step._replace(reward=reward)

    def _cut(self, step: Step) -> Step:
        """With new episodes where the old ones have reached the limit."""
        late = (self._length >= self._limit) & step.valid & ~(step.terminated | step.truncated)
        if not late.any():
            return step
        words = f"An episode of {self._name!r} did not end in {self._limit:,} steps"
        begun_anew = getattr(self._worlds, "begun_anew", None)
        if begun_anew is None:
            raise ValueError(
                f"{words}, and a vector environment cannot be told to cut it: make its copies with "
                "a time limit, or train without evaluations (--evaluation-episodes 0)."
            )
        if not self._limit_known and self._new:
            raise ValueError(
                f"{words}, and no time limit is known: give one (--time-limit N), or train without "
                "evaluations (--evaluation-episodes 0)."
            )
        if not self._limit_known:
            warnings.warn(
                f"{words} and is cut there, for no time limit is known: give one (--time-limit N).",
                stacklevel=4,
            )
        return step._replace(
            truncated=step.truncated | late,
            observation=begun_anew(step.observation, np.flatnonzero(late).tolist()),
        )

    def _tell(self, wrong: np.ndarray, reward: np.ndarray | None, seen: np.ndarray) -> None:
        """Says once in an evaluation what is not finite, and that its episode has no return."""
        if self._told or not wrong.any():
            return
        self._told, i = True, int(np.argmax(wrong))
        if reward is not None and not np.isfinite(reward[i]):
            what = f"a reward of {reward[i]}"
        else:
            k = int(np.argmin(np.isfinite(seen[i])))
            what = f"{seen[i, k]} as component {k} of the observation"
        where = self._when(i, int(self._length[i]))
        warnings.warn(
            f"The world {self._name!r} returned {what}, {where}: the return of that episode is "
            "none, and its evaluation does not count.",
            stacklevel=4,
        )

    def _when(self, i: int, step: int) -> str:
        start = f"at step {step:,}" if step else "at the start"
        return f"{start} of an evaluation episode{f' in copy {i}' if self.num > 1 else ''}"
