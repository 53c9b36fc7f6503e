"""One process at a time in a directory."""

import contextlib
import fcntl
from collections.abc import Iterator
from pathlib import Path

LOCK = ".lock"


class RunDirectoryError(Exception):
    """A directory that cannot be used; the message is one sentence for the user."""


@contextlib.contextmanager
def locked(path: Path) -> Iterator[None]:
    """Holds a directory that exists; nobody else may enter.

    Raises:
        RunDirectoryError: Somebody else is there.
    """
    with (path / LOCK).open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RunDirectoryError(
                f"{path} is in use by another process: wait for it, or choose another --output."
            ) from None
        try:
            yield
        finally:
            (path / LOCK).unlink(missing_ok=True)
