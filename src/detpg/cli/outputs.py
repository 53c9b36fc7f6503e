"""Files that a command is told to write: refused before time is spent on what could not be kept."""

import tempfile
from pathlib import Path

from detpg.cli.errors import UserError


def checked_kind(output: Path, kinds: tuple[str, ...]) -> str:
    """What a file is, by its ending.

    Raises:
        UserError: None of the kinds.
    """
    kind = output.suffix.removeprefix(".").lower()
    if kind not in kinds:
        endings = [f".{kind}" for kind in kinds]
        listed = f"{', '.join(endings[:-1])} or {endings[-1]}"
        raise UserError(f"{output} is of no known kind: let it end with {listed}.")
    return kind


def check_writable(output: Path) -> None:
    """Refuses a place where no file can be written.

    Raises:
        UserError: It is a folder, or its folder is missing or closed.
    """
    try:
        if output.is_dir():
            raise IsADirectoryError(0, "is a folder")
        with tempfile.TemporaryFile(dir=output.parent):
            pass
    except OSError as error:
        raise unwritable(output, error) from error


def unwritable(output: Path, error: OSError) -> UserError:
    """What is said of a file that could not be written."""
    return UserError(f"{output} cannot be written to ({error.strerror}): choose another --output.")
