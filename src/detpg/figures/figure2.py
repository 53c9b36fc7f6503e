"""Figure 2 and what belongs beside it: both settings, final returns of all runs, sensitivity."""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from detpg.experiments.figure2 import ARMS, HORIZONS
from detpg.experiments.figure2_claims import COPDAC, SETTINGS
from detpg.experiments.published import SOURCE, published_curve
from detpg.figures.style import PUBLISHED, new_figure, save, style

FILES = ("figure2.png", "figure2.svg", "figure2.pdf", "distributions.png", "sensitivity.png")

TITLES = {
    "mountain-car": "mountain car",
    "pendulum": "pendulum swing-up",
    "puddle-world": "puddle world",
}
# Each line differs in hue, lightness and marker, so that it can be told apart in greyscale.
SERIES: dict[str, dict[str, Any]] = {
    COPDAC: {"color": "#08306b", "marker": "o", "linestyle": "-"},
    "SAC": {"color": "#c1440e", "marker": "s", "linestyle": "-"},
    "OffPAC-TD": {"color": "#2f8f5b", "marker": "^", "linestyle": "-"},
}
PUBLISHED_DASHES = {COPDAC: "-", "SAC": "--", "OffPAC-TD": ":"}
LOWEST_SHOWN = {"mountain-car": -6e3, "pendulum": -6e3, "puddle-world": -2.2e4}
RULE = "mean"


def draw(directory: Path) -> None:
    """Draws every picture of Figure 2 from the tables in a directory."""
    bands, runs = (pl.read_parquet(directory / f"{name}.parquet") for name in ("bands", "curves"))
    many = "interval" if "interval" in bands["phase"] else "fresh"
    bands, runs = bands.filter(phase=many, role=RULE), runs.filter(phase=many, role=RULE)
    finals = runs.filter(pl.col("step") == pl.col("step").max().over("task"))
    with style():
        save(_curves(bands), directory, "figure2", ("png", "svg", "pdf"))
        save(_distributions(finals), directory, "distributions", ("png",))
        scores = pl.read_parquet(directory / "scores.parquet")
        save(_sensitivity(scores), directory, "sensitivity", ("png",))


def _curves(bands: pl.DataFrame) -> Figure:
    """A row for each setting of the baselines, a column for each task."""
    figure = new_figure(10, 6.8)
    axes = figure.subplots(2, 3, sharex="col", sharey="col")
    for row, (setting, arms) in zip(axes, SETTINGS.items(), strict=True):
        for axis, task in zip(row, HORIZONS, strict=True):
            _published(axis, task)
            axis.axhline(0, color="0.85", linewidth=0.6)
            for series, arm in ({COPDAC: COPDAC} | arms).items():
                _band(axis, bands.filter(task=task, arm=arm).sort("step"), series)
            axis.set_title(f"{TITLES[task]}, baselines {setting}", fontsize=9)
            axis.set_ylim(bottom=LOWEST_SHOWN[task])
        row[0].set_ylabel("return of the mean policy")
    for axis in axes[-1]:
        axis.set_xlabel("training steps (thousands)")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    num_runs = int(bands["num_runs"][0])
    title = "Best points by area under the curve: mean and 95% interval over"
    figure.suptitle(f"{title} {num_runs} fresh runs, less those that diverged", fontsize=10)
    return figure


def _published(axis: Axes, task: str) -> None:
    for series, dashes in PUBLISHED_DASHES.items():
        columns = published_curve("figure2", task, series, ("x", "y", "low", "high"))
        x, y, low, high = columns
        error = np.stack([y - low, high - y])
        label = f"{series}, {SOURCE}"
        axis.errorbar(x / 1e3, y, error, linestyle=dashes, elinewidth=0.7, label=label, **PUBLISHED)


def _band(axis: Axes, rows: pl.DataFrame, series: str) -> None:
    if not rows.height:
        return
    steps, mean, low, high = (rows[name].to_numpy() for name in ("step", "mean", "low", "high"))
    look = SERIES[series]
    axis.plot(steps / 1e3, mean, label=series, markersize=3.5, linewidth=1.6, **look)
    axis.fill_between(steps / 1e3, low, high, color=look["color"], alpha=0.2, linewidth=0)
    diverged, num_runs = int(rows["num_diverged"][0]), int(rows["num_runs"][0])
    if diverged:
        place = 0.04 + 0.07 * list(SERIES).index(series)
        words = f"{series}: {diverged} of {num_runs} runs diverged"
        axis.annotate(words, (0.97, place), xycoords="axes fraction", ha="right", fontsize=7)


def _distributions(finals: pl.DataFrame) -> Figure:
    """Final return of every run: a mean hides the mixture of solved and stuck runs."""
    arms = [arm.name for arm in ARMS if arm.name in set(finals["arm"])]
    figure = new_figure(10, 0.42 * len(arms) + 1.6)
    axes = figure.subplots(1, 3, sharey=True)
    for axis, task in zip(axes, HORIZONS, strict=True):
        for height, arm in enumerate(arms):
            values = finals.filter(task=task, arm=arm)["return"].to_numpy()
            kept = values[np.isfinite(values)]
            spread = np.random.default_rng(0).uniform(-0.28, 0.28, kept.size)
            axis.plot(kept, height + spread, ".", markersize=3, alpha=0.5, color="#08306b")
            if kept.size:
                axis.plot(np.median(kept), height, "|", color="#c1440e", markersize=13, mew=2)
            if kept.size < values.size:
                words = f"{values.size - kept.size} diverged"
                place = (0.02, height)
                axis.annotate(
                    words, place, xycoords=("axes fraction", "data"), fontsize=7, va="center"
                )
        axis.set_title(TITLES[task])
        axis.set_xlabel("final return")
        if task != "pendulum":
            axis.set_xscale("symlog", linthresh=20)
    axes[0].set_yticks(range(len(arms)), arms)
    axes[0].invert_yaxis()
    figure.suptitle("Final return of every fresh run (dots) and their median (bar)", fontsize=10)
    return figure


def _sensitivity(scores: pl.DataFrame) -> Figure:
    """The best mean return that each value of each step size allows."""
    arms = [arm for arm in ARMS if arm.name in set(scores["arm"])]
    swept = {arm.name: [name for name, values in arm.grid if len(values) > 1] for arm in arms}
    num_columns = max(map(len, swept.values()))
    figure = new_figure(2.6 * num_columns, 2.0 * len(arms) + 0.8)
    axes = figure.subplots(len(arms), num_columns, sharey="row", squeeze=False)
    for row, arm in zip(axes, arms, strict=True):
        for axis in row[len(swept[arm.name]) :]:
            axis.set_visible(False)
        for axis, name in zip(row, swept[arm.name], strict=False):
            _sensitivity_panel(axis, scores.filter(arm=arm.name), name)
            tied = "".join(f" = {other}" for other, source in arm.ties if source == name)
            axis.set_xlabel(f"step size {name}{tied}", fontsize=8)
        row[0].set_ylabel("mean return")
        row[0].set_title(arm.name, loc="left", fontsize=9)
    handles, texts = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, texts, loc="outside lower center", ncols=3, frameon=False)
    title = (
        "Best mean return over the run that each step size allows, over all others (sweep seeds)"
    )
    figure.suptitle(title, fontsize=10)
    return figure


def _sensitivity_panel(axis: Axes, scores: pl.DataFrame, name: str) -> None:
    markers = dict(zip(HORIZONS, "os^", strict=True))
    colours = dict(zip(HORIZONS, ("#9ecae1", "#08306b", "#c1440e"), strict=True))
    for task in HORIZONS:
        finite = scores.filter(pl.col("mean_return").is_finite(), task=task)
        best = finite.group_by(name).agg(pl.col("mean_return").max()).sort(name)
        x, y = best[name].to_numpy(), best["mean_return"].to_numpy()
        label = TITLES[task]
        axis.plot(x, y, color=colours[task], marker=markers[task], markersize=3.5, label=label)
    if name == "alpha_y":
        axis.set_xscale("symlog", linthresh=1e-7)
    else:
        axis.set_xscale("log")
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.set_ylim(-6e3, 5.2e3)
