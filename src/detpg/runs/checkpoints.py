"""Checkpoints: whole or not there, checked when they are read, the last few kept."""

import errno
import hashlib
import json
import os
import shutil
from pathlib import Path

import jax
import numpy as np
from jaxtyping import PyTree

from detpg.runs.arrays import plain, typed
from detpg.runs.directory import write_json
from detpg.runs.lock import RunDirectoryError


class Checkpoints:
    """A folder of checkpoints, written by Orbax, with a digest of each beside it.

    A checkpoint is there once its digest is: a process killed in between leaves none. What was
    damaged later is told by the digest, and the one before it is used.

    Attributes:
        path: The folder.
        keep: How many are kept.
        damaged: Those that were passed over when one was read, by name.
    """

    def __init__(self, path: Path, keep: int = 3):
        """Names the folder; touches nothing."""
        self.path, self.keep = path.absolute(), keep
        self.damaged: list[str] = []

    @property
    def steps(self) -> list[int]:
        """Those that are there, oldest first."""
        return sorted(int(found.stem) for found in self.path.glob("*.json") if found.stem.isdigit())

    def save(self, step: int, tree: PyTree) -> None:
        """Keeps a tree of arrays.

        Raises:
            RunDirectoryError: It could not be written; those before it are untouched.
        """
        folder = self._folder(step)
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            for remains in (*self.path.glob(f"{folder.name}*"), *self.path.glob("*orbax*tmp*")):
                _remove(remains)
            _write(folder, _numbered(tree))
            write_json(self._digest(step), _digests(folder))
        except (OSError, ValueError, RuntimeError) as error:  # tensorstore's errors are the last
            good = f"the last good one is {self.steps[-1]}" if self.steps else "there is none"
            full = os.strerror(errno.ENOSPC)  # which tensorstore wraps in several lines
            words = getattr(error, "strerror", None) or str(error).splitlines()[0]
            reason = full if full in str(error) else words
            raise RunDirectoryError(
                f"The checkpoint of step {step} cannot be written to {self.path} ({reason}): make "
                f"room or choose another --output; {good}."
            ) from error
        for old in self.steps[: -self.keep]:
            self._digest(old).unlink()
            shutil.rmtree(self._folder(old), ignore_errors=True)

    def restore(self, like: PyTree) -> tuple[int, PyTree] | None:
        """The newest whole checkpoint and its step; None where there is none.

        Args:
            like: A tree of arrays of the same structure, shapes and dtypes.
        """
        self.damaged = []
        for step in reversed(self.steps):
            tree = self._read(step, like)
            if tree is not None:
                return step, tree
            self.damaged.append(self._folder(step).name)
        return None

    def _read(self, step: int, like: PyTree) -> PyTree | None:
        folder = self._folder(step)
        try:
            if json.loads(self._digest(step).read_text()) != _digests(folder):
                return None
        except (OSError, ValueError):
            return None
        leaves, structure = jax.tree.flatten(like)
        found = _load(folder, _numbered(like))
        return structure.unflatten(
            # Empty ones are not kept.
            [
                typed(found[str(i)], leaf) if str(i) in found else leaf
                for i, leaf in enumerate(leaves)
            ]
        )

    def _folder(self, step: int) -> Path:
        return self.path / f"{step:012d}"

    def _digest(self, step: int) -> Path:
        return self.path / f"{step:012d}.json"


def _numbered(tree: PyTree) -> dict[str, np.ndarray]:
    """The leaves by number, a key as its data; Orbax takes none that are empty."""
    leaves = [plain(leaf) for leaf in jax.tree.leaves(tree)]
    return {str(i): leaf for i, leaf in enumerate(leaves) if leaf.size}


def _write(folder: Path, content: dict[str, np.ndarray]) -> None:
    import orbax.checkpoint as orbax

    with orbax.Checkpointer(orbax.StandardCheckpointHandler()) as writer:
        writer.save(folder, args=orbax.args.StandardSave(content))


def _load(folder: Path, like: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    import orbax.checkpoint as orbax

    with orbax.Checkpointer(orbax.StandardCheckpointHandler()) as reader:
        found = reader.restore(folder, args=orbax.args.StandardRestore(like, strict=False))
    return {name: _fitted(array, like[name].shape) for name, array in found.items()}


def _fitted(array: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """As it is, or a memory (worlds, rows, columns) with at least as many rows as are asked for.

    Raises:
        RunDirectoryError: It is of another shape.
    """
    if array.shape == shape:
        return array
    if not len(shape) == array.ndim == 3 or array.shape[::2] != shape[::2]:
        raise RunDirectoryError(
            f"A checkpoint holds numbers of shape {array.shape} where {shape} are needed: give the "
            "environment and the policy that the run was begun with."
        )
    return np.pad(array, ((0, 0), (0, max(shape[1] - array.shape[1], 0)), (0, 0)))


def _digests(folder: Path) -> dict[str, str]:
    """SHA-256 of every file of a folder."""
    files = sorted(found for found in folder.rglob("*") if found.is_file())
    return {
        str(found.relative_to(folder)): hashlib.sha256(found.read_bytes()).hexdigest()
        for found in files
    }


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
