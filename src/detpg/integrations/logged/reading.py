"""Where the data lie: a Parquet file, a folder, a Minari data set by its folder or name."""

import re
import warnings
from pathlib import Path

import numpy as np

from detpg.integrations.logged import parquet
from detpg.integrations.logged.assembling import assembled, text
from detpg.integrations.logged.parts import Part
from detpg.replaying import Logged
from detpg.types import Bounds


def read(path: str | Path, bounds: Bounds | None = None) -> Logged:
    """Reads logged transitions.

    Args:
        path: A Parquet file, a folder of them, the folder of a Minari data set, or the name of a
            local one. docs/logged_data.md names the columns.
        bounds: The box of legal actions, in the data's units; what the data say, when not given,
            and else the least and greatest action in them, with a warning. If the data say
            otherwise there is a warning too.

    Raises:
        ValueError: Says what is wrong with the data, where, and how to mend it.
    """
    parts, said = _parts(path)
    if bounds is not None and said is not None and _single(bounds.meant) != _single(said.meant):
        warnings.warn(
            f"{path} says that actions lie between {text(said.low)} and {text(said.high)}, but "
            f"{text(bounds.low)} and {text(bounds.high)} are taken: log actions in the world's own "
            "units.",
            stacklevel=2,
        )
    return assembled(str(path), parts, bounds or said)


def _single(bounds: Bounds) -> list[list[float]]:
    """As spaces of single precision hold them."""
    return [np.asarray(end, np.float32).tolist() for end in bounds]


def _parts(path: str | Path) -> tuple[list[Part], Bounds | None]:
    place = Path(path)
    if place.is_file():
        return parquet.parts([place])
    if place.suffix == ".parquet" and not place.exists():
        raise ValueError(f"There is no file {path}: give the path of one.")
    if not place.exists() or (place / "data" / "metadata.json").exists():
        # The only place that needs the package, which brings h5py along.
        from detpg.integrations.logged import minari

        return minari.parts(str(path))
    files = [file for file in place.rglob("*.parquet") if not file.name.startswith(".")]
    if not files:
        raise ValueError(
            f"{path} holds no Parquet file and is no Minari data set: give a file *.parquet, a "
            "folder with such files, or a data set's name or folder."
        )
    return parquet.parts(sorted(files, key=_natural))


def _natural(file: Path) -> list[tuple[int, str]]:
    """Names in their order, `part-2` before `part-10`."""
    pieces = re.findall(r"\d+|\D+", str(file))
    return [(int(piece) if piece.isdigit() else -1, piece) for piece in pieces]
