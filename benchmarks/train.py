"""Several seeds in one program, beside one."""

from collections.abc import Callable, Iterable

import jax

from benchmarks.rows import Row
from benchmarks.runs import least_seconds, session
from detpg.workbench import Config, Session

STEPS = 2_000
SEEDS = 8


def seeds() -> tuple[float, str, float, float, str]:
    """Eight learners in one program, beside one."""
    runs = [session(Config("copdac-q", "pendulum", seeds=num)) for num in (SEEDS, 1)]

    def block(run: Session) -> Callable[[], None]:
        def advance() -> None:
            jax.block_until_ready(run.engine.advance(run.kept.state, STEPS))

        advance()
        return advance

    value, baseline = least_seconds(*map(block, runs))
    note = f"{SEEDS} seeds over one seed, time of a step of all: lower is better; target below 3"
    return 1e6 * value / STEPS, "µs/step", 1e6 * baseline / STEPS, value / baseline, note


IDS = ("train.seeds8_vs_1",)


def rows(wanted: Iterable[str]) -> list[Row]:
    return [Row(name, *seeds()) for name in wanted]
