"""The pictures of `detpg verify`: one for each group of checks, from its table of points."""

import itertools
from pathlib import Path
from typing import Any

import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from detpg.figures.style import new_figure, save, style

TITLES = {
    "theorem-1": "Theorem 1 on the LQR: the gradient by finite differences and by samples",
    "theorem-2": "Theorem 2: the limit of the stochastic policy gradient",
    "theorem-3": "Theorem 3: a compatible critic is wrong and the gradient right",
    "off-policy": "Eq. 15 on the LQR: what the dropped term costs",
    "variance": "Section 6: variance of the stochastic gradient",
    "natural-gradient": "The metric M as the limit of the Fisher metric",
    "behaviour": "COPDAC-Q's critic learns the behaviour's value",
    "convergence": "COPDAC-Q and COPDAC-GQ off policy, expected updates",
}
FILES = tuple(f"{name}.{kind}" for name in TITLES for kind in ("png", "svg"))
SPAN = 30.0  # an axis whose positive numbers span more is logarithmic

# Each line differs in hue, lightness and marker, so that it can be told apart in greyscale.
LOOKS: tuple[dict[str, Any], ...] = (
    {"color": "#08306b", "marker": "o"},
    {"color": "#c1440e", "marker": "s"},
    {"color": "#4292c6", "marker": "^"},
    {"color": "#e6a817", "marker": "D"},
)
GUIDE: dict[str, Any] = {"color": "0.55", "linestyle": (0, (4, 3)), "linewidth": 1.0, "zorder": 1}


def draw(directory: Path) -> None:
    """Draws every picture from `points.csv` in a directory."""
    points = pl.read_csv(directory / "points.csv")
    with style():
        for name in TITLES:
            save(_figure(points.filter(group=name), TITLES[name]), directory, name, ("png", "svg"))


def _figure(points: pl.DataFrame, title: str) -> Figure:
    """A panel for each pair of quantities, side by side."""
    panels = points.partition_by("x_name", "y_name", maintain_order=True)
    figure = new_figure(max(5.2 * len(panels), 6.0), 4.2)
    for axis, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        _panel(axis, panel)
    figure.suptitle(title, fontsize=10)
    return figure


def _panel(axis: Axes, panel: pl.DataFrame) -> None:
    looks = itertools.cycle(LOOKS)
    for line in panel.partition_by("series", maintain_order=True):
        _line(axis, line, looks)
    axis.set_xlabel(panel["x_name"][0])
    axis.set_ylabel(panel["y_name"][0])
    axis.set_xscale("log" if _spans(panel["x"]) else "linear")
    axis.set_yscale("log" if _spans(panel["y"]) else "linear")
    axis.legend(frameon=False)


def _line(axis: Axes, line: pl.DataFrame, looks: Any) -> None:
    kind, _, words = line["series"][0].rpartition(": ")
    x, y, error = (line[name].to_numpy() for name in ("x", "y", "error"))
    if kind == "guide":
        axis.plot(x, y, label=words, **GUIDE)
        return
    look = next(looks)
    axis.errorbar(
        x,
        y,
        4 * error if error.any() else None,
        label=line["series"][0],
        markersize=4,
        linewidth=1.4,
        capsize=2,
        **look,
    )


def _spans(values: pl.Series) -> bool:
    """Whether numbers are positive and of many sizes."""
    low, high = float(values.min()), float(values.max())  # pyright: ignore[reportArgumentType]
    return low > 0 and high / low > SPAN
