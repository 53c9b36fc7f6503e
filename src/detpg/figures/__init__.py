"""Stop 8: tidy tables drawn as pictures.

In: the tables of a run directory. Out: png, svg and pdf files beside them.
"""

from collections.abc import Callable
from pathlib import Path

from detpg.figures import figure1, figure2, figure3, theorems

FIGURES: dict[str, tuple[tuple[str, ...], Callable[[Path], None]]] = {
    "figure1": (figure1.FILES, figure1.draw),
    "figure2": (figure2.FILES, figure2.draw),
    "figure3": (figure3.FILES, figure3.draw),
    "theorems": (theorems.FILES, theorems.draw),
}


def draw(name: str, directory: Path) -> None:
    """Draws every picture of a study into its run directory."""
    FIGURES[name][1](directory)


def missing(name: str, directory: Path) -> list[str]:
    """Pictures that a study's run directory lacks."""
    return [file for file in FIGURES[name][0] if not (directory / file).exists()]


__all__ = ["FIGURES", "draw", "missing"]
