"""The pictures of `detpg verify`: one for each group of checks, from its table of points."""

import itertools
import textwrap
from pathlib import Path
from typing import Any

import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter, NullLocator

from detpg.figures.style import new_figure, save, style

TITLES = {
    "theorem-1": "Theorem 1 on the LQR: the gradient by finite differences and by samples",
    "theorem-2": "Theorem 2: the limit of the stochastic policy gradient",
    "theorem-3": "Theorem 3: the compatible critic's slope is wrong, and the gradient right",
    "off-policy": "Eq. 15 on the LQR: what the dropped term costs",
    "variance": "Section 6: variance of the stochastic gradient",
    "natural-gradient": "The metric M as the limit of the Fisher metric",
    "behaviour": "COPDAC-Q's critic learns the behaviour's value",
    "convergence": "COPDAC-Q and COPDAC-GQ off policy, expected updates",
}
FILES = tuple(f"{name}.{kind}" for name in TITLES for kind in ("png", "svg"))
WIDTH = 50  # characters of a line of an axis label
MANY = 30  # points above which a line has few markers
DISCRETE = "state"  # abscissa whose points are not joined

# Each line differs in hue, lightness, marker and dashes: it can be told apart in greyscale.
LOOKS: tuple[dict[str, Any], ...] = (
    {"color": "#08306b", "marker": "o", "linestyle": "-"},
    {"color": "#c1440e", "marker": "s", "linestyle": (0, (6, 1.5))},
    {"color": "#4292c6", "marker": "^", "linestyle": (0, (2, 1.5))},
    {"color": "#e6a817", "marker": "D", "linestyle": (0, (6, 1.5, 1, 1.5))},
)
GUIDE: dict[str, Any] = {"color": "0.55", "linestyle": ":", "linewidth": 1.4, "zorder": 1}
GUIDE_AT = 0.4  # of the line that it goes with, so that both are seen
SIGNS = (
    ("sigma", "σ"),
    ("theta", "θ"),
    ("beta", "β"),
    ("^-1/2", "$^{-1/2}$"),
    ("^-2", "⁻²"),
    ("^1", ""),
    ("^2", "²"),
    ("^4", "⁴"),
    ("J_β", "$J_β$"),
)


def draw(directory: Path) -> None:
    """Draws a picture of each group in `points.csv` of a directory."""
    points = pl.read_csv(directory / "points.csv")
    with style():
        for (name,), group in points.group_by("group", maintain_order=True):
            save(_figure(group, TITLES[str(name)]), directory, str(name), ("png", "svg"))


def _figure(points: pl.DataFrame, title: str) -> Figure:
    """A panel for each pair of quantities, side by side."""
    panels = points.partition_by("x_name", "y_name", maintain_order=True)
    figure = new_figure(max(5.0 * len(panels), 6.4), 4.6)
    for axis, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        _panel(axis, panel)
    figure.suptitle(title, fontsize=10)
    return figure


def _panel(axis: Axes, panel: pl.DataFrame) -> None:
    """Powers on logarithmic axes, what spans many decades on a logarithmic ordinate."""
    powers = panel["series"].str.starts_with("guide: ").any()
    y = panel["y"].to_numpy()
    decades = y.min() > 0 and y.max() > 1e6 * y.min()
    axis.set_xscale("log" if powers else "linear")
    axis.set_yscale("log" if powers or decades else "linear")
    looks = itertools.cycle(LOOKS)
    for line in panel.partition_by("series", maintain_order=True):
        if line["series"][0].startswith("guide: "):
            label = _pretty(line["series"][0].removeprefix("guide: "))
            axis.plot(line["x"], GUIDE_AT * line["y"], label=f"slope of {label}", **GUIDE)
        else:
            _line(axis, line, next(looks))
    axis.set_xlabel(textwrap.fill(_pretty(panel["x_name"][0]), WIDTH))
    axis.set_ylabel(textwrap.fill(_pretty(panel["y_name"][0]), WIDTH))
    if powers:
        _counts(axis, panel["x"])
    if panel["x_name"][0] == DISCRETE:
        axis.xaxis.set_major_locator(MaxNLocator(integer=True))
    if panel["series"].n_unique() > 1:
        bars = "bars: 4 standard errors" if (panel["error"] > 0).any() else None
        place = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.2), "borderaxespad": 0.0}
        axis.legend(frameon=False, ncols=2, title=bars, title_fontsize=8, **place)


def _counts(axis: Axes, x: pl.Series) -> None:
    """Whole numbers on a logarithmic abscissa are written as such."""
    axis.xaxis.set_minor_formatter(NullFormatter())
    if (x == x.round()).all():
        axis.set_xticks(x.unique(), labels=[f"{value:g}" for value in x.unique()])
        axis.xaxis.set_minor_locator(NullLocator())


def _line(axis: Axes, line: pl.DataFrame, look: dict[str, Any]) -> None:
    """One line; with bars of 4 standard errors where it has any."""
    x, y, error = (line[name].to_numpy() for name in ("x", "y", "error"))
    joined = {} if line["x_name"][0] != DISCRETE else {"linestyle": "none", "markersize": 7}
    axis.errorbar(
        x,
        y,
        4 * error if error.any() else None,
        label=_pretty(line["series"][0]),
        capsize=2,
        fillstyle="none" if joined and not error.any() else "full",
        markevery=len(x) // 10 if len(x) > MANY else 1,
        **{"markersize": 4, "linewidth": 1.4, **look, **joined},
    )


def _pretty(words: str) -> str:
    """Greek letters and powers as they are printed."""
    for plain, sign in SIGNS:
        words = words.replace(plain, sign)
    return words
