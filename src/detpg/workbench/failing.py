"""What is known where a world fails: at which step of a run, and how to go on."""

import contextlib
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from detpg.runs import Checkpoints
from detpg.workbench.config import Config
from detpg.workbench.folder import CHECKPOINTS
from detpg.world_error import WorldError


@contextlib.contextmanager
def in_training(
    config: Config, step: int, reached: Callable[[], tuple[Any, int] | None] = lambda: None
) -> Iterator[None]:
    """Says at which step a world failed, from 1, and of several seeds, of which.

    Args:
        config: Of the run.
        step: Taken by each learner before.
        reached: The state of the engine then, and the steps since.
    """
    try:
        yield
    except WorldError as error:
        error.reached = reached()
        step += 0 if error.reached is None else error.reached[1]
        seed, world = divmod(error.index or 0, config.num_envs)
        whose = f" of seed {seed}" if error.index is not None and config.seeds > 1 else ""
        error.when = f"at step {step + world + 1:,} of training{whose}"
        raise


@contextlib.contextmanager
def of_run(path: Path, config: Config, own: str | None, named: bool) -> Iterator[None]:
    """Says how to go on once the world is mended.

    Args:
        path: Of the run.
        config: Of the run.
        own: The user's policy as FILE.py:NAME, where there is one.
        named: Whether the command line can build the world and the policy again.
    """
    try:
        yield
    except WorldError as error:
        kept = Checkpoints(path / CHECKPOINTS).steps
        if not kept:
            error.advice = "No checkpoint is kept."
            raise
        if not named:
            error.advice = (
                f"The last good checkpoint is {kept[-1]}: once the world is mended, call train_in "
                "again with it."
            )
            raise
        words = ["detpg", "resume", str(path)]
        words += [] if own is None else ["--own-policy", own]
        if ":" in str(config.environment):
            words += ["--own-environment", str(config.environment)]
        error.advice = (
            f"The last good checkpoint is {kept[-1]}: once the world is mended, go on with "
            f"`{shlex.join(words)}`."
        )
        raise
