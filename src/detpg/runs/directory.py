"""A directory that holds one run: refused when it holds another, resumed when it holds this one."""

import contextlib
import io
import json
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np

from detpg.runs.lock import RunDirectoryError, locked
from detpg.version import __version__

CONFIG, SUMMARY, SHARDS = "config.json", "summary.json", "shards"
WRITTEN = (
    "*.parquet",
    "*.png",
    "*.svg",
    "*.pdf",
    "*.mp4",
    "*.npz",
    "claims.md",
)  # left beside the JSON files
MARK = "detpg"  # with the version: says that a directory is ours, and whose numbers these are


def write_atomically(path: Path, write: Callable[[IO[bytes]], Any]) -> None:
    """Writes a file that is either whole or absent, also after a crash.

    Args:
        path: Where it is to stand.
        write: Called with an open binary file in the same directory.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with partial.open("wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def write_json(path: Path, content: Any) -> None:
    """A JSON file for people and programs: indented, no NaN."""
    text = json.dumps(content, indent=2, allow_nan=False) + "\n"
    write_atomically(path, lambda file: file.write(text.encode()))


class RunDirectory:
    """One run's directory: `config.json`, `shards/`, and at the end `summary.json`."""

    def __init__(self, path: Path, config: dict[str, Any]):
        """Names a directory and the configuration it must hold; touches nothing."""
        self.path = path
        self.config = {MARK: __version__, **config}

    @property
    def finished(self) -> bool:
        """Whether the run was completed: its summary is written last."""
        return (self.path / SUMMARY).exists()

    @contextlib.contextmanager
    def opened(self, fresh: bool = False) -> Iterator[None]:
        """Creates the directory, or checks that it holds this very run; nobody else may enter.

        Args:
            fresh: Start over: the shards, tables, pictures and report of an earlier run of any
                configuration are removed; other files and folders are left alone.

        Raises:
            RunDirectoryError: It holds another configuration or something else, it is in use, or
                it cannot be written to. Nothing in it was changed.
        """
        self._check_ours(fresh)
        with contextlib.ExitStack() as held:
            try:
                self.path.mkdir(parents=True, exist_ok=True)
                held.enter_context(locked(self.path))
                self._check_ours(fresh)  # again, now that nobody else can change it
                self._prepare(fresh)
            except OSError as error:
                raise RunDirectoryError(
                    f"{self.path} cannot be written to ({error.strerror}): choose another --output."
                ) from error
            yield

    def _check_ours(self, fresh: bool) -> None:
        found = self._found_config()
        if found is None or found == self.config or fresh:
            return
        keys = sorted({*found, *self.config})
        different = [key for key in keys if found.get(key) != self.config.get(key)]
        raise RunDirectoryError(
            f"{self.path} holds a run with another configuration (different: "
            f"{', '.join(different)}): choose another --output, or start over with --fresh."
        )

    def _prepare(self, fresh: bool) -> None:
        """Removes what a killed process or, if told to, an earlier run left; makes what is missing.

        The summary goes first and the configuration last, so that a process killed in between
        leaves a directory that is neither finished nor somebody else's.
        """
        for partial in self.path.glob(".*.part"):
            partial.unlink()
        if fresh:
            (self.path / SUMMARY).unlink(missing_ok=True)
            shutil.rmtree(self.path / SHARDS, ignore_errors=True)
            for entry in (found for pattern in WRITTEN for found in self.path.glob(pattern)):
                entry.unlink()
        if fresh or not (self.path / CONFIG).exists():
            write_json(self.path / CONFIG, self.config)
        if self.finished:
            shutil.rmtree(self.path / SHARDS, ignore_errors=True)
        else:
            (self.path / SHARDS).mkdir(exist_ok=True)

    def _found_config(self) -> dict[str, Any] | None:
        """The configuration that stands here; None where there is nothing of ours or anyone's."""
        try:
            found = json.loads((self.path / CONFIG).read_text())
        except FileNotFoundError:
            if self.path.is_dir() and any(entry.name[0] != "." for entry in self.path.iterdir()):
                raise RunDirectoryError(self._not_ours()) from None
            return None
        except NotADirectoryError:
            raise RunDirectoryError(
                f"{self.path} is not a directory: choose another --output."
            ) from None
        except (OSError, ValueError) as error:
            raise RunDirectoryError(
                f"{self.path / CONFIG} cannot be read ({error}): choose another --output."
            ) from error
        if not isinstance(found, dict) or MARK not in found:
            raise RunDirectoryError(self._not_ours())
        return found

    def _not_ours(self) -> str:
        return f"{self.path} holds files that are not a run of detpg: choose another --output."

    @property
    def shards(self) -> Path:
        """Where finished shards are kept until the run is completed."""
        return self.path / SHARDS

    def shard(self, name: str) -> np.ndarray | None:
        """A finished shard; None if it is absent or damaged, and so has to run (again)."""
        try:
            # No pickle: an array of objects could carry code.
            return np.load(self.path / SHARDS / f"{name}.npy", allow_pickle=False)
        except (FileNotFoundError, ValueError, EOFError):
            return None

    def save_shard(self, name: str, result: np.ndarray) -> None:
        """Keeps a finished shard."""
        content = io.BytesIO()
        # No pickle, as when it is loaded: what could carry code is refused here already.
        np.save(content, result, allow_pickle=False)
        path = self.path / SHARDS / f"{name}.npy"
        write_atomically(path, lambda file: file.write(content.getbuffer()))

    @property
    def seconds(self) -> float:
        """Wall time of earlier sessions of this run."""
        try:
            return float((self.path / SHARDS / "seconds").read_text())
        except (FileNotFoundError, ValueError):
            return 0.0

    @seconds.setter
    def seconds(self, value: float) -> None:
        path = self.path / SHARDS / "seconds"
        write_atomically(path, lambda file: file.write(f"{value:.3f}".encode()))

    def finish(self, summary: dict[str, Any]) -> None:
        """Marks the run as completed. The shards, now in the tables, are removed."""
        write_json(self.path / SUMMARY, summary)
        shutil.rmtree(self.path / SHARDS)
