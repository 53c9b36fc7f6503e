"""Scalars as TensorBoard event files, a folder for each seed."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any


class Scalars:
    """Event files of a run; what a killed run wrote beyond its checkpoint is purged."""

    def __init__(self, path: Path, seeds: int, step: int):
        """Opens a writer for each seed.

        Args:
            path: The folder; `tensorboard --logdir` takes it or one above.
            seeds: Number of learners.
            step: What was written after this step is replaced; that of the step itself stays.
        """
        from tensorboardX import SummaryWriter

        # A file is named by its second alone: a run resumed within it would write over the first.
        own = {"purge_step": step + 1, "filename_suffix": f".{step}"}
        self._writers = [SummaryWriter(str(path / f"seed{i}"), **own) for i in range(seeds)]

    def write(self, seed: int, step: int, values: Mapping[str, Any]) -> None:
        """Adds the values that are finite numbers; others could not be drawn."""
        for name, value in values.items():
            if value is not None and math.isfinite(value):
                self._writers[seed].add_scalar(name, value, step)

    def flush(self) -> None:
        """What was written is on disk."""
        for writer in self._writers:
            writer.flush()

    def close(self) -> None:
        """Ends the files."""
        for writer in self._writers:
            writer.close()
