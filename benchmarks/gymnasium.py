"""The host's loop over a Gymnasium environment, beside a bare one."""

from collections.abc import Iterable
from typing import Any

import gymnasium
import jax
import numpy as np

from benchmarks.rows import Row
from benchmarks.runs import least_seconds, session
from detpg.workbench import Config
from detpg.workbench.hosted import Hosted

STEPS = 2_000


def overhead() -> tuple[float, str, float, float, str]:
    """The loop over a Gymnasium environment, beside `env.step` and the compiled update alone."""
    run = session(Config("copdac-q", "Pendulum-v1"))
    engine: Any = run.engine
    assert isinstance(engine, Hosted)
    state = engine.advance(run.kept.state, 100)
    leaves, structure = jax.tree.flatten(state)
    program, keys = engine._program, engine._keys
    env = gymnasium.make("Pendulum-v1", disable_env_checker=True)
    seen = np.zeros((1, 1, 2 * engine.spec.observation_size + 4), np.float32)
    size = engine.spec.observation_size

    def ours() -> None:
        nonlocal state
        state = engine.advance(state, STEPS)

    def bare() -> None:
        """What cannot be left out: the world's step, its numbers handed over, the update."""
        kept, action = leaves, np.zeros(1, np.float32)
        env.reset(seed=0)
        for _ in range(STEPS):
            observation, reward, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                observation, _ = env.reset()
            seen[0, 0, :size] = seen[0, 0, size:-4] = observation
            seen[0, 0, -4:] = reward, terminated, truncated, True
            kept, chosen = program(structure, keys, kept, seen)
            action = np.asarray(chosen)[0, 0]

    value, baseline = least_seconds(ours, bare)
    env.close()
    engine.close()
    note = "the loop over a bare one with the same update: lower is better; target below 1.15"
    return 1e6 * value / STEPS, "µs/step", 1e6 * baseline / STEPS, value / baseline, note


IDS = ("gymnasium.overhead",)


def rows(wanted: Iterable[str]) -> list[Row]:
    return [Row(name, *overhead()) for name in wanted]
