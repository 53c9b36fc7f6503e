"""Figure 3 and what belongs beside it: all learners, sensitivity, a learnt strike."""

from pathlib import Path
from typing import Any

import jax
import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from detpg.environments import OctopusArm
from detpg.experiments.figure3 import ARMS, MAIN
from detpg.experiments.figure3_claims import NUM_PUBLISHED, SOLVED
from detpg.experiments.octopus_shards import POLICY, environment_of, kept_policy
from detpg.experiments.published import SOURCE, published_curve
from detpg.figures import octopus
from detpg.figures.animation import animate
from detpg.figures.style import new_figure, save, style
from detpg.runs import write_atomically
from detpg.types import Policy

FILES = (
    "figure3.png",
    "figure3.svg",
    "figure3.pdf",
    "learners.png",
    "sensitivity.png",
    "strike.png",
    "octopus.mp4",
    "octopus.gif",
)
RULE = "mean"
OURS, THEIRS = "#08306b", "0.55"
PANELS = (("return", "return (reward units)"), ("steps", "steps to target"))
SHOWN_AT = (0.35, 0.7, 1.0)  # parts of the strike in the still


def draw(directory: Path) -> None:
    """Draws every picture of Figure 3 from what its run directory holds."""
    runs = pl.read_parquet(directory / "curves.parquet").filter(role=RULE)
    with style():
        save(_main_figure(runs), directory, "figure3", ("png", "svg", "pdf"))
        save(_learners(runs), directory, "learners", ("png",))
        scores = pl.read_parquet(directory / "scores.parquet")
        save(_sensitivity(scores), directory, "sensitivity", ("png",))
    _film(directory)


def _main_figure(runs: pl.DataFrame) -> Figure:
    """Returns above, steps below: the published runs, ten of ours, and both means."""
    figure = new_figure(6.4, 7)
    axes = figure.subplots(2, 1, sharex=True)
    here = runs.filter(arm=MAIN)
    for axis, (measure, label) in zip(axes, PANELS, strict=True):
        _published(axis, measure)
        _ours(axis, here, measure)
        axis.set_ylabel(label)
    axes[1].axhline(SOLVED, color="0.8", linewidth=0.8)
    axes[1].set_xlabel("training steps (thousands)")
    handles, labels = axes[1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False)
    figure.suptitle(
        f"Octopus arm, {MAIN}: ten fresh runs (thin) and the mean of all (thick);\n"
        "the scale of the published return is not known",
        fontsize=9,
    )
    return figure


def _published(axis: Axes, measure: str) -> None:
    for i in range(NUM_PUBLISHED):
        x, y = published_curve("figure3", measure, f"run {i + 1}")
        axis.plot(x / 1e3, y, color=THEIRS, linewidth=0.5, alpha=0.6)
    x, y = published_curve("figure3", measure, "mean")
    axis.plot(x / 1e3, y, color=THEIRS, linewidth=2, linestyle="--", label=f"mean, {SOURCE}")


def _ours(axis: Axes, runs: pl.DataFrame, measure: str) -> None:
    for seed in range(NUM_PUBLISHED):
        rows = runs.filter(seed=seed).sort("step")
        axis.plot(rows["step"] / 1e3, rows[measure], color=OURS, linewidth=0.5, alpha=0.6)
    mean = runs.group_by("step").agg(pl.col(measure).mean()).sort("step")
    label = f"mean of {runs['seed'].n_unique()} fresh runs"
    axis.plot(mean["step"] / 1e3, mean[measure], color=OURS, linewidth=2, label=label)


def _learners(runs: pl.DataFrame) -> Figure:
    """Steps to the target of all fresh runs of each learner."""
    arms = [arm.name for arm in ARMS if arm.name in set(runs["arm"])]
    num_rows = -(-len(arms) // 3)
    num_columns = min(3, len(arms))
    figure = new_figure(3.5 * num_columns + 0.4, 2.6 * num_rows + 0.7)
    axes = figure.subplots(num_rows, num_columns, sharex=True, sharey=True, squeeze=False)
    for axis in axes.flat[len(arms) :]:
        axis.set_visible(False)
    for axis, arm in zip(axes.flat, arms, strict=False):
        _published(axis, "steps")
        for seed in runs["seed"].unique():
            rows = runs.filter(arm=arm, seed=seed).sort("step")
            axis.plot(rows["step"] / 1e3, rows["steps"], color=OURS, linewidth=0.4, alpha=0.4)
        mean = runs.filter(arm=arm).group_by("step").agg(pl.col("steps").mean()).sort("step")
        axis.plot(mean["step"] / 1e3, mean["steps"], color=OURS, linewidth=2)
        axis.set_title(arm, fontsize=9)
    for axis in axes[:, 0]:
        axis.set_ylabel("steps to target")
    for axis in axes[-1]:
        axis.set_xlabel("training steps (thousands)")
    title = (
        "Each learner at its best point: fresh runs (thin), their mean, the published runs (grey)"
    )
    figure.suptitle(title, fontsize=10)
    return figure


def _sensitivity(scores: pl.DataFrame) -> Figure:
    """The least mean number of steps that each value of each hyper-parameter allows."""
    arms = [arm for arm in ARMS if arm.name in set(scores["arm"])]
    swept = {arm.name: [name for name, values in arm.grid if len(values) > 1] for arm in arms}
    num_columns = max(1, *map(len, swept.values()), 1)
    figure = new_figure(2.6 * num_columns + 0.4, 2.2 * max(1, len(arms)) + 0.6)
    axes = figure.subplots(max(1, len(arms)), num_columns, sharey=True, squeeze=False)
    for row, arm in zip(axes, arms, strict=False):
        for axis in row[len(swept[arm.name]) :]:
            axis.set_visible(False)
        for axis, name in zip(row, swept[arm.name], strict=False):
            here = scores.filter(pl.col("mean_steps").is_finite(), arm=arm.name)
            best = here.group_by(name).agg(pl.col("mean_steps").min()).sort(name)
            x, y = best[name].to_numpy(), best["mean_steps"].to_numpy()
            axis.plot(x, y, color=OURS, marker="o", markersize=4)
            axis.set_xscale("log")
            axis.set_xlabel(name)
        row[0].set_ylabel("mean steps to target")
        row[0].set_title(arm.name, loc="left", fontsize=9)
    title = "Least mean steps over the run that each value allows, over all others (sweep seeds)"
    figure.suptitle(title, fontsize=10)
    return figure


def _film(directory: Path) -> None:
    """A strike of the kept policy, as a film and as a still of three moments."""
    states, actions, steps = _strike(directory)
    pictures = list(octopus.frames(environment_of(ARMS[0]), states, actions))
    # Each frame stands for 5 units of time; the last one stays for a second and a half.
    for kind in ("mp4", "gif"):
        film = animate([*pictures, *[pictures[-1]] * 15], kind, fps=10)
        write_atomically(directory / f"octopus.{kind}", lambda file, film=film: file.write(film))
    shown = [pictures[min(round(part * steps), len(pictures) - 1)] for part in SHOWN_AT]
    with style():
        figure = new_figure(9, 3.1)
        for axis, picture in zip(figure.subplots(1, len(shown)), shown, strict=True):
            axis.imshow(picture)
            axis.set_axis_off()
        save(figure, directory, "strike", ("png",))


def learnt(path: Path) -> tuple[OctopusArm, Policy, Any]:
    """The octopus arm, the policy, and the theta that a study of Figure 3 kept in a file.

    Raises:
        FileNotFoundError: It is not there, damaged, or of another policy.
    """
    arm = next(arm for arm in ARMS if arm.name == MAIN)
    environment = environment_of(arm)
    return environment, *kept_policy(arm, environment, path)


def _strike(directory: Path) -> tuple[Any, Any, int]:
    """States and actions of one episode, from the start to the hit; how many steps it took."""
    environment, policy, theta = learnt(directory / POLICY)
    key = jax.random.key(0)

    def body(state: Any, _: None) -> tuple[Any, Any]:
        action = policy(theta, environment.observe(state))
        next_state = environment.transition(key, state, action)
        return next_state, (next_state, action, environment.terminated(next_state))

    start = environment.initial(key)
    _, (states, actions, hits) = jax.jit(
        lambda state: jax.lax.scan(body, state, None, length=environment.time_limit)
    )(start)
    hits = np.asarray(hits)
    steps = int(hits.argmax()) + 1 if hits.any() else environment.time_limit
    return jax.tree.map(lambda x: x[:steps], states), actions[:steps], steps
