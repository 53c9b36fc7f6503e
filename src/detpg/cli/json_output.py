"""JSON alone on standard output: what a user's world prints goes to standard error."""

import contextlib
import json
import os
import sys
from collections.abc import Iterator
from typing import Any, TextIO

_json: TextIO | None = None  # where it goes while everything else is turned away


@contextlib.contextmanager
def json_alone(for_good: bool) -> Iterator[None]:
    """Turns away whatever is printed, by Python, by compiled code or by processes started here.

    Args:
        for_good: Also what is printed after it, until the process ends.
    """
    global _json
    shown = sys.stdout
    if shown is None:  # closed: nobody reads it
        yield
        return
    shown.flush()
    away = _away()  # before another could take the place of a closed standard error
    kept = os.dup(1)
    os.dup2(away, 1)
    os.close(away)
    is_process_s = _number(shown) == 1
    _json = os.fdopen(os.dup(kept), "w", encoding=shown.encoding) if is_process_s else shown
    sys.stdout = sys.stderr
    try:
        yield
    finally:
        if not for_good:
            sys.stdout, _json = shown, None
            os.dup2(kept, 1)
        os.close(kept)


def print_json(found: Any) -> None:
    """Prints what a command has found; NaN, which JSON does not know, is refused."""
    print(json.dumps(found, indent=2, allow_nan=False), file=_json or sys.stdout, flush=True)


def _away() -> int:
    """The process's standard error, or nowhere if that is closed."""
    try:
        return os.dup(2)
    except OSError:
        return os.open(os.devnull, os.O_WRONLY)


def _number(stream: TextIO) -> int | None:
    try:
        return stream.fileno()
    except (OSError, ValueError, AttributeError):  # a stream in memory has none
        return None
