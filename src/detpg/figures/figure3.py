"""Figure 3 and what belongs beside it: the settings that were swept, a learnt strike."""

from pathlib import Path

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from detpg.experiments.figure3 import ARMS, MAIN
from detpg.experiments.figure3_claims import NUM_PUBLISHED, SOLVED
from detpg.experiments.published import SOURCE, published_curve
from detpg.figures.style import new_figure, save, style

FILES = ("figure3.png", "figure3.svg", "figure3.pdf", "sensitivity.png")
RULE = "mean"
OURS, THEIRS = "#08306b", "0.55"
PANELS = (("return", "return of the mean policy (reward units)"), ("steps", "steps to target"))


def draw(directory: Path) -> None:
    """Draws every picture of Figure 3 from the tables in a directory."""
    runs = pl.read_parquet(directory / "curves.parquet").filter(role=RULE)
    with style():
        save(_main_figure(runs), directory, "figure3", ("png", "svg", "pdf"))
        scores = pl.read_parquet(directory / "scores.parquet")
        save(_sensitivity(scores), directory, "sensitivity", ("png",))


def _main_figure(runs: pl.DataFrame) -> Figure:
    """A column for each learner: returns above, steps below; ten thin runs and their mean."""
    arms = [arm.name for arm in ARMS if arm.name in set(runs["arm"])]
    figure = new_figure(4.6 * len(arms) + 0.6, 6.4)
    axes = figure.subplots(2, len(arms), sharex=True, sharey="row", squeeze=False)
    for column, arm in zip(axes.T, arms, strict=True):
        for axis, (measure, label) in zip(column, PANELS, strict=True):
            _published(axis, measure)
            _ours(axis, runs.filter(arm=arm), measure)
            axis.set_ylabel(label)
        column[0].set_title(arm)
        column[1].axhline(SOLVED, color="0.8", linewidth=0.8)
        column[1].set_xlabel("training steps (thousands)")
    handles, labels = axes[1, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False)
    figure.suptitle(
        "Octopus arm, six segments: ten fresh runs (thin), mean over all fresh runs (thick);\n"
        "the scale of the published return is not known",
        fontsize=10,
    )
    return figure


def _published(axis: Axes, measure: str) -> None:
    for i in range(NUM_PUBLISHED):
        x, y = published_curve("figure3", measure, f"run {i + 1}")
        axis.plot(x / 1e3, y, color=THEIRS, linewidth=0.5, alpha=0.6)
    x, y = published_curve("figure3", measure, "mean")
    axis.plot(x / 1e3, y, color=THEIRS, linewidth=2, linestyle="--", label=f"mean, {SOURCE}")


def _ours(axis: Axes, runs: pl.DataFrame, measure: str) -> None:
    for (_, seed), rows in runs.filter(phase="fresh").group_by("phase", "seed"):
        if seed < NUM_PUBLISHED:
            rows = rows.sort("step")
            axis.plot(rows["step"] / 1e3, rows[measure], color=OURS, linewidth=0.5, alpha=0.6)
    many = runs.filter(phase="interval" if "interval" in runs["phase"] else "fresh")
    mean = many.group_by("step").agg(pl.col(measure).mean()).sort("step")
    label = f"mean of {many['seed'].n_unique()} fresh runs"
    axis.plot(mean["step"] / 1e3, mean[measure], color=OURS, linewidth=2, label=label)


def _sensitivity(scores: pl.DataFrame) -> Figure:
    """The least mean number of steps that each value of each hyper-parameter allows."""
    arms = [arm for arm in ARMS if arm.name in set(scores["arm"])]
    swept = {arm.name: [name for name, values in arm.grid if len(values) > 1] for arm in arms}
    num_columns = max(1, *map(len, swept.values()))
    figure = new_figure(2.6 * num_columns + 0.4, 2.2 * len(arms) + 0.6)
    axes = figure.subplots(len(arms), num_columns, sharey=True, squeeze=False)
    for row, arm in zip(axes, arms, strict=True):
        for axis in row[len(swept[arm.name]) :]:
            axis.set_visible(False)
        for axis, name in zip(row, swept[arm.name], strict=False):
            here = scores.filter(pl.col("mean_steps").is_finite(), arm=arm.name)
            best = here.group_by(name).agg(pl.col("mean_steps").min()).sort(name)
            x, y = best[name].to_numpy(), best["mean_steps"].to_numpy()
            axis.plot(x, y, color=OURS, marker="o", markersize=4)
            axis.set_xscale("log" if np.all(x > 0) else "linear")
            axis.set_xlabel(name)
        row[0].set_ylabel("mean steps to target")
        row[0].set_title(arm.name, loc="left", fontsize=9)
    title = "Least mean steps over the run that each value allows, over all others (sweep seeds)"
    figure.suptitle(title, fontsize=10)
    return figure
