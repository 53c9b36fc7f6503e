"""Environment steps per second of the octopus arm, against plain NumPy."""

import functools
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PRNGKeyArray

from benchmarks.numpy_octopus import NumpyOctopus
from benchmarks.rows import Row
from detpg.environments import OctopusArm
from detpg.environments.octopus_arm.body import at_rest, body_of
from detpg.environments.octopus_arm.physics import activate, derivative
from detpg.executors import Processes
from detpg.machine import cores

IDS = ("octopus.batch1", "octopus.batch256", "octopus.segments12_vs_6")
BATCH = 256
ROUNDS = 5
EVALUATIONS = 100  # of the forces, in one environment step


class Task(NamedTuple):
    """What a worker plays: actions are uniform, new at each step, and nothing is reset."""

    parameters: str
    segments: int
    arms: int
    steps: int
    plain: bool = False  # the baseline, which has neither reward nor hit test


def rows(wanted: tuple[str, ...]) -> Iterator[Row]:
    """Each row is measured in processes of its own."""
    makers = {
        "octopus.batch1": _one_arm,
        "octopus.batch256": _batch,
        "octopus.segments12_vs_6": _longer_arm,
    }
    for name in wanted:
        yield makers[name](name)


def _one_arm(name: str) -> Row:
    task, plain = Task("A", 6, 1, 1000), Task("A", 6, 1, 20, plain=True)
    (rate, compiling), (baseline, _) = _rate(task, 1), _rate(plain, 1)
    return _row(name, task, rate, baseline, compiling, "on one core")


def _batch(name: str) -> Row:
    workers = cores()
    task, plain = Task("A", 6, BATCH, 40), Task("A", 6, BATCH, 2, plain=True)
    (rate, compiling), (baseline, _) = _rate(task, workers), _rate(plain, workers)
    words = f"in {workers} processes of {BATCH} arms each"
    return _row(name, task, rate, baseline, compiling, words)


def _row(name: str, task: Task, rate: float, baseline: float, compiling: float, words: str) -> Row:
    flop = _flop_of_forces(task)
    return Row(
        id=name,
        value=rate,
        unit="steps/s",
        baseline=baseline,
        ratio=rate / baseline,
        note=f"{words}, float32, with reward and hit test; {flop / 1e3:.0f} kflop of forces a step "
        f"by XLA's count, {rate * flop / 1e9:.1f} GFlop/s; compiled in {compiling:.1f} s; baseline "
        "NumPy, all nodes and arms at once, float64, forces and integration only",
    )


def _longer_arm(name: str) -> Row:
    tasks = [Task("B", segments, BATCH, 20) for segments in (6, 12)]
    short, long = (1e6 / _rate(task, 1)[0] for task in tasks)
    return Row(
        id=name,
        value=long,
        unit="µs/step",
        baseline=short,
        ratio=long / short,
        note="cost with 12 segments over cost with 6, batches of 256 on one core: lower is "
        "better, 2 is linear",
    )


def _rate(task: Task, workers: int) -> tuple[float, float]:
    """Environment steps per second of all workers together, best of some rounds; compile time."""
    tasks, groups = [task] * workers, range(workers)
    least = float("inf")
    with Processes(_play, workers) as executor:
        compiling = max(seconds for _, seconds in executor.run(tasks, groups))
        for _ in range(ROUNDS):
            began = time.perf_counter()
            list(executor.run(tasks, groups))
            least = min(least, time.perf_counter() - began)
    return workers * task.arms * task.steps / least, compiling


def _play(task: Task) -> float:
    """Plays once; returns how long the program took to compile."""
    play, compiling = _player(task)
    play()
    return compiling


@functools.cache
def _player(task: Task) -> tuple[Callable[[], Any], float]:
    if task.plain:
        return functools.partial(_play_plain, task), 0.0
    world, keys = OctopusArm(task.segments, task.parameters), jax.random.key(0)
    play = functools.partial(_play_ours, steps=task.steps)
    if task.arms > 1:
        play, keys = jax.vmap(play, in_axes=(None, 0)), jax.random.split(keys, task.arms)
    began = time.perf_counter()
    program = jax.jit(play).lower(world, keys).compile()
    compiling = time.perf_counter() - began
    return lambda: jax.block_until_ready(program(world, keys)), compiling


def _play_ours(world: OctopusArm, key: PRNGKeyArray, steps: int) -> Any:
    def step(state: Any, at: Any) -> Any:
        action = jax.random.uniform(jax.random.fold_in(key, at), (world.spec.action_size,))
        next_state = world.transition(key, state, action)
        reward = world.reward(state, action, next_state)
        seen = world.observe(next_state), reward, world.terminated(next_state)
        return next_state, jax.tree.map(jnp.sum, seen)

    return jax.lax.scan(step, world.initial(key), jnp.arange(steps))


def _play_plain(task: Task) -> None:
    parameters = OctopusArm(task.segments, task.parameters).parameters
    arms = () if task.arms == 1 else (task.arms,)
    simulator, random = NumpyOctopus(parameters, arms), np.random.default_rng(0)
    state = simulator.initial()
    for _ in range(task.steps):
        state = simulator.step(state, random.random((2 + 3 * task.segments, *arms)))


def _flop_of_forces(task: Task) -> float:
    """Floating-point operations in the forces of one environment step, as XLA counts them."""
    parameters = OctopusArm(task.segments, task.parameters).parameters
    body, arm = body_of(parameters), at_rest(parameters)
    pull = activate(body, jnp.zeros(2 + 3 * task.segments))
    counted = jax.jit(derivative).lower(body, pull, arm).compile().cost_analysis() or {}
    return EVALUATIONS * counted["flops"]
