"""The loop over time, compiled for one task and one learner at a time."""

import functools
import hashlib
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
from numba.extending import register_jitable

from detpg.kernels.learners import LEARNERS
from detpg.kernels.learners.learner import dot
from detpg.kernels.random import EVALUATION, TRAINING, normal
from detpg.kernels.tasks import TASKS
from detpg.kernels.tiles import activate


class World(NamedTuple):
    """A task's numbers, and how the learner's action units become its own: centre + half a."""

    constants: np.ndarray
    centre: np.ndarray
    half: np.ndarray
    low: np.ndarray
    high: np.ndarray
    time_limit: int


class Plan(NamedTuple):
    """Steps to learn for, steps at which the mean policy is played (ascending), and how often."""

    horizon: int
    evaluate_at: np.ndarray
    episodes: int


class Records(NamedTuple):
    """What is measured, one entry for each point, run and evaluation.

    Attributes:
        returns: Undiscounted return of the mean policy, mean over its episodes.
        steps: Their length, mean over episodes.
        saturated: Share of those steps whose action lies beyond the legal range.
        finite: Whether all learnt numbers are finite; what else is measured is NaN if not.
    """

    returns: np.ndarray
    steps: np.ndarray
    saturated: np.ndarray
    finite: np.ndarray


@register_jitable
def _all_finite(numbers):
    for i in range(numbers.shape[0]):
        for j in range(numbers.shape[1]):
            if not math.isfinite(numbers[i, j]):
                return False
    return True


@register_jitable
def _play(start, move, world, tiles, stream, weights, state, active):
    """One episode of the mean policy: return, steps, steps with an action beyond the range."""
    constants, centre, half, low, high, time_limit = world
    legal = np.zeros(centre.size)
    earned, saturated = 0.0, 0
    start(constants, stream, state)
    for t in range(time_limit):
        activate(tiles, state, active)
        beyond = False
        for k in range(legal.size):
            legal[k] = centre[k] + half[k] * dot(weights, k, active)
            beyond |= legal[k] < low[k] or legal[k] > high[k]
        saturated += beyond
        reward, terminated = move(constants, stream, state, legal)
        earned += reward
        if terminated:
            return earned, t + 1, saturated
    return earned, time_limit, saturated


@register_jitable
def _evaluate(start, move, world, tiles, stream, weights, episodes, records, at):
    """Measures the mean policy; False, and nothing measured, if its numbers are not finite."""
    point, run, upcoming = at
    if not _all_finite(weights):
        return False
    state = np.zeros(tiles.grid.size)
    active = np.zeros(tiles.first.size + (tiles.bias >= 0), np.uint32)
    earned, steps, saturated = 0.0, 0, 0
    for _ in range(episodes):
        played = _play(start, move, world, tiles, stream, weights, state, active)
        earned, steps, saturated = earned + played[0], steps + played[1], saturated + played[2]
    records.returns[point, run, upcoming] = earned / episodes
    records.steps[point, run, upcoming] = steps / episodes
    records.saturated[point, run, upcoming] = saturated / steps
    records.finite[point, run, upcoming] = True
    return True


def _run_of(
    start: Callable[..., Any],
    move: Callable[..., Any],
    behave: Callable[..., Any],
    learn: Callable[..., Any],
    version: str,
) -> Callable[..., None]:
    """One run of one point, not compiled yet; `at` says which.

    One function, and not one that calls another: each would be optimised for itself and once more
    where it is called, which doubles the time of compilation.
    """

    def one_run(world, tiles, plan, hyper, streams, weights, records, at):
        """Learns and is evaluated along the way; stops where the learner is no longer finite."""
        _ = version  # part of the key under which the machine code is kept
        constants, centre, half = world.constants, world.centre, world.half
        training, m = streams[TRAINING], centre.size
        horizon, evaluate_at, episodes = plan
        time_limit = world.time_limit
        state, legal = np.zeros(tiles.grid.size), np.zeros(m)
        num_active = tiles.first.size + (tiles.bias >= 0)
        active, next_active = np.zeros(num_active, np.uint32), np.zeros(num_active, np.uint32)
        mean, width = np.zeros(m, weights.dtype), np.zeros(m, weights.dtype)
        deviation = np.zeros(m, weights.dtype)
        start(constants, training, state)
        activate(tiles, state, active)
        length, upcoming = 0, 0
        for t in range(horizon + 1):
            while upcoming < evaluate_at.size and evaluate_at[upcoming] == t:
                here = (at[0], at[1], upcoming)
                playing = streams[EVALUATION]
                if not _evaluate(
                    start, move, world, tiles, playing, weights, episodes, records, here
                ):
                    return
                upcoming += 1
            if t == horizon:
                return
            behave(weights, active, hyper, mean, width)
            for k in range(m):
                if not (math.isfinite(mean[k]) and math.isfinite(width[k])):
                    return
                deviation[k] = width[k] * normal(training)
                legal[k] = centre[k] + half[k] * (mean[k] + deviation[k])
            reward, terminated = move(constants, training, state, legal)
            length += 1
            ended = terminated or length == time_limit
            activate(tiles, state, next_active)
            learn(weights, active, next_active, deviation, width, reward, terminated, ended, hyper)
            if ended:
                length = 0
                start(constants, training, state)
                activate(tiles, state, active)
            else:
                for i in range(num_active):
                    active[i] = next_active[i]

    return one_run


@functools.cache
def compiled(task: str, learner: str) -> Callable[..., None]:
    """One run of a task and a learner, compiled on first use and kept on disk.

    It lets other threads run beside it.
    """
    start, move = TASKS[task].start, TASKS[task].move
    behave, learn = LEARNERS[learner].behave, LEARNERS[learner].learn
    return numba.njit(nogil=True, cache=True)(_run_of(start, move, behave, learn, _version()))


@functools.cache
def replayed(learner: str) -> Callable[..., None]:
    """One learner fed with recorded transitions."""
    behave, learn = LEARNERS[learner].behave, LEARNERS[learner].learn

    @numba.njit
    def replay_all(weights, hyper, active, next_active, actions, rewards, terminated, ended):
        mean, width = np.zeros_like(actions[0]), np.zeros_like(actions[0])
        for t in range(len(rewards)):
            behave(weights, active[t], hyper, mean, width)
            deviation = actions[t] - mean
            learn(
                weights,
                active[t],
                next_active[t],
                deviation,
                width,
                rewards[t],
                terminated[t],
                ended[t],
                hyper,
            )

    return replay_all


@functools.cache
def _version() -> str:
    """Digest of the sources that are compiled: numba itself notices changes in this file alone."""
    package = Path(__file__).parents[1]
    folders = ("environments", "features", "kernels", "policies")
    files = sorted(path for folder in folders for path in (package / folder).rglob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()
