"""What the benchmarks of runs share: sessions, and times taken in turns."""

import time
from collections.abc import Callable

from detpg.workbench import Config, Session
from detpg.workbench.engines import engine_of
from detpg.workbench.learners import learner

BLOCKS = 15


def session(config: Config) -> Session:
    """A run in memory, before its first step."""
    engine = engine_of(config)
    return Session(config, engine, learner(config, engine.spec))


def least_seconds(*blocks: Callable[[], None]) -> list[float]:
    """The least CPU time of each, in turns, so that a busy moment of the machine meets all."""
    found = [[_seconds(block) for block in blocks] for _ in range(BLOCKS)]
    return [min(times) for times in zip(*found, strict=True)]


def _seconds(block: Callable[[], None]) -> float:
    began = time.process_time()
    block()
    return time.process_time() - began
