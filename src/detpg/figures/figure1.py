"""Figure 1 and what belongs beside it: readings, curves at fixed width, sensitivity."""

import itertools
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from detpg.experiments.figure1 import (
    ACTORS,
    COPDAC,
    DIMENSIONS,
    PUBLISHED_WIDTH,
    SIGMAS,
    SPECTRA,
    adapted,
)
from detpg.experiments.published import SOURCE, published_curve
from detpg.figures.style import PUBLISHED, new_figure, save, style

FILES = (
    "figure1.png",
    "figure1.svg",
    "figure1.pdf",
    "readings.png",
    "fixed_sigma.png",
    "sensitivity.png",
)

# Each line differs in hue, lightness and dashes, so that it can be told apart in greyscale.
LINES: tuple[tuple[str, str, str, dict[str, Any]], ...] = (
    (COPDAC, "", "COPDAC-B, best σ", {"color": "#08306b", "linestyle": "-", "linewidth": 1.8}),
    (
        COPDAC,
        f" {PUBLISHED_WIDTH}",
        "COPDAC-B, σ = 0.1",
        {"color": "#4292c6", "linestyle": (0, (1, 1)), "linewidth": 1.5},
    ),
    (
        adapted(ACTORS[0]),
        "",
        "SAC-B, score times Q",
        {"color": "#c1440e", "linestyle": (0, (5, 1.5)), "linewidth": 1.8},
    ),
    (
        adapted(ACTORS[1]),
        "",
        "SAC-B, score times advantage",
        {"color": "#e6a817", "linestyle": (0, (3, 1, 1, 1)), "linewidth": 1.8},
    ),
)
HIGHEST_SHOWN = 1e3
RULE_WORDS = {"final": "final cost", "mean": "mean cost"}


def draw(directory: Path) -> None:
    """Draws every picture of Figure 1 from the two small tables in a directory."""
    bands = pl.read_parquet(directory / "bands.parquet")
    # Fresh seeds: the many runs for intervals where there are any, else the paper's number.
    bands = bands.filter(phase="interval" if "interval" in bands["phase"] else "fresh")
    with style():
        save(_main_figure(bands), directory, "figure1", ("png", "svg", "pdf"))
        save(_readings(bands), directory, "readings", ("png",))
        save(_fixed_sigma(bands), directory, "fixed_sigma", ("png",))
        save(
            _sensitivity(pl.read_parquet(directory / "scores.parquet")),
            directory,
            "sensitivity",
            ("png",),
        )


def _main_figure(bands: pl.DataFrame) -> Figure:
    """Three panels: the literal text (C mixed), points chosen by the final cost."""
    figure = new_figure(10, 4.1)
    axes = figure.subplots(1, 3, sharey=True)
    for axis, m in zip(axes, DIMENSIONS, strict=True):
        _panel(axis, bands, m, "mixed", "final")
        axis.set_title(f"m = {m}")
        axis.set_xlabel("environment steps")
    axes[0].set_ylabel("cost of the mean action (cost units)")
    _legend(figure, axes[0])
    figure.suptitle(
        "Continuous bandit, C mixed, best of the grid by final cost: mean and 95% interval over "
        f"{_num_runs(bands)} runs",
        fontsize=10,
    )
    return figure


def _readings(bands: pl.DataFrame) -> Figure:
    """A row for each reading of C and of "best performing", a column for each m."""
    figure = new_figure(10, 11)
    rows = list(itertools.product(SPECTRA, RULE_WORDS))
    axes = figure.subplots(len(rows), 3, sharex=True, sharey=True)
    for row, (spectrum, rule) in zip(axes, rows, strict=True):
        for axis, m in zip(row, DIMENSIONS, strict=True):
            _panel(axis, bands, m, spectrum, rule)
            axis.set_title(f"m = {m}, C {spectrum}, best by {RULE_WORDS[rule]}", fontsize=9)
        row[0].set_ylabel("cost of the mean action")
    for axis in axes[-1]:
        axis.set_xlabel("environment steps")
    _legend(figure, axes[0, 0])
    title = f"Figure 1 in each reading: mean and 95% interval over {_num_runs(bands)} runs"
    figure.suptitle(title, fontsize=10)
    return figure


def _legend(figure: Figure, axis: Axes) -> None:
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)


def _panel(axis: Axes, bands: pl.DataFrame, m: int, spectrum: str, rule: str) -> None:
    """Published curves and ours."""
    for series, dashes in (("SAC-B", "--"), ("COPDAC-B", "-")):
        x, y = published_curve("figure1", f"m={m}", series)
        axis.plot(x, y, linestyle=dashes, label=f"{series}, {SOURCE}", **PUBLISHED)
    lost = []
    for arm, width, label, line in LINES:
        rows = _rows(bands, m, spectrum, arm, rule + width)
        if rows.height:
            _curve(axis, rows, label, line)
            diverged, num_runs = rows["num_diverged"][0], rows["num_runs"][0]
            lost += [f"{label}: {diverged} of {num_runs} runs diverged"] if diverged else []
    axis.set(xscale="log", yscale="log", xlim=(100, 10_000), ylim=(1e-9, 2e3))
    axis.annotate("\n".join(lost), (0.03, 0.03), xycoords="axes fraction", fontsize=7)


def _curve(axis: Axes, rows: pl.DataFrame, label: str, line: dict[str, Any]) -> None:
    """Mean over the runs that stayed finite, with its interval."""
    steps, mean, low, high = (rows[name].to_numpy() for name in ("step", "mean", "low", "high"))
    axis.plot(steps, mean, label=label, **line)
    axis.fill_between(steps, low, high, color=line["color"], alpha=0.22, linewidth=0)


def _rows(bands: pl.DataFrame, m: int, spectrum: str, arm: str, role: str) -> pl.DataFrame:
    return bands.filter(m=m, spectrum=spectrum, arm=arm, role=role).sort("step")


def _num_runs(bands: pl.DataFrame) -> int:
    """Runs behind each mean: all lines of a figure have as many."""
    return int(bands["num_runs"][0])


def _fixed_sigma(bands: pl.DataFrame) -> Figure:
    """COPDAC-B at each width of the grid: its floor falls with sigma squared."""
    figure = new_figure(10, 6.6)
    axes = figure.subplots(2, 3, sharex=True, sharey=True)
    widths = [s for s in SIGMAS if bands.filter(role=f"final sigma={s:g}").height]
    colours = mpl.colormaps["viridis"](np.linspace(0, 0.92, len(widths)))
    for row, spectrum in zip(axes, SPECTRA, strict=True):
        for axis, m in zip(row, DIMENSIONS, strict=True):
            x, y = published_curve("figure1", f"m={m}", "COPDAC-B")
            axis.plot(x, y, label=f"COPDAC-B, {SOURCE}", **PUBLISHED)
            for sigma, colour in zip(widths, colours, strict=True):
                rows = _rows(bands, m, spectrum, COPDAC, f"final sigma={sigma:g}")
                _curve(axis, rows, f"σ = {sigma:g}", {"color": colour, "linewidth": 1.4})
            axis.set(xscale="log", yscale="log", xlim=(100, 10_000))
            axis.set_title(f"m = {m}, C {spectrum}")
        row[0].set_ylabel("cost of the mean action")
    for axis in axes[-1]:
        axis.set_xlabel("environment steps")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, frameon=False)
    title = "COPDAC-B at each width σ of its behaviour, step size chosen by final cost"
    figure.suptitle(f"{title}: mean and 95% interval over {_num_runs(bands)} runs", fontsize=10)
    return figure


def _sensitivity(scores: pl.DataFrame) -> Figure:
    """The best final cost that each value of each hyper-parameter allows."""
    arms = [arm for arm, width, *_ in LINES if not width and arm in set(scores["arm"])]
    names = ("alpha_theta", "sigma", "alpha_y")
    labels = ("step size α_θ of the mean", "σ (SAC-B: initial)", "step size α_y of log variance")
    figure = new_figure(10, 2.7 * len(arms) + 0.8)
    axes = figure.subplots(len(arms), 3, sharey=True, squeeze=False)
    for row, arm in zip(axes, arms, strict=True):
        for axis, name, label in zip(row, names, labels, strict=True):
            here = scores.filter(pl.col(name).is_not_null(), arm=arm)
            axis.set_visible(here.height > 0)
            _sensitivity_panel(axis, here, name)
            axis.set_xlabel(label)
        row[0].set_ylabel("final cost")
        row[0].set_title(arm, loc="left")
    handles, texts = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, texts, loc="outside lower center", ncols=3, frameon=False)
    title = "Best final cost that each value allows, over all other hyper-parameters (sweep seeds)"
    figure.suptitle(f"{title}; values that diverge are left out", fontsize=10)
    return figure


def _sensitivity_panel(axis: Axes, scores: pl.DataFrame, name: str) -> None:
    markers = dict(zip(DIMENSIONS, "os^", strict=True))
    colours = dict(zip(DIMENSIONS, ("#9ecae1", "#4292c6", "#08306b"), strict=True))
    for spectrum, m in itertools.product(SPECTRA, DIMENSIONS):
        best = scores.filter(m=m, spectrum=spectrum).group_by(name).agg(pl.col("final_cost").min())
        best = best.filter(pl.col("final_cost") < HIGHEST_SHOWN).sort(name)
        axis.plot(
            best[name].to_numpy(),
            best["final_cost"].to_numpy(),
            color=colours[m],
            marker=markers[m],
            markersize=3.5,
            linestyle="-" if spectrum == "mixed" else ":",
            label=f"m = {m}, {spectrum}",
        )
    axis.set(xscale="log", yscale="log")
