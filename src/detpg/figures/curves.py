"""Learning curves of runs, compared: a panel for each environment, a line for each run."""

import io
import itertools
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation

from detpg.evaluation import Estimate, estimate
from detpg.evaluation.statistics import Statistic
from detpg.experiments.tables import BAND_RESAMPLES
from detpg.figures.measured import Curve, read
from detpg.figures.style import new_figure, save, style
from detpg.runs import write_atomically

# Neighbours differ in hue, lightness and dashes, so that they can be told apart in greyscale.
_COLOURS = ("#08306b", "#d95f0e", "#1b9e77", "#cc4c9b", "#8c6d31", "#4292c6", "#525252")
_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (3, 1, 1, 1)))
_UNITS = {
    "return": "return (reward units)",
    "length": "episode length (steps)",
    "rollout/ep_rew_mean": "return while exploring (reward units)",
    "rollout/ep_len_mean": "episode length while exploring (steps)",
    "train/td_error": "TD error, root mean square (reward units)",
    "train/value": "value by the critic (reward units)",
    "train/saturated": "actions on a bound (share)",
    "train/exploration": "deviation from the policy (half ranges)",
}
_WORDS = {"iqm": "IQM", "mean": "mean"}
_SCALES = ((2e6, 1e6, " (millions)"), (1e4, 1e3, " (thousands)"), (0, 1, ""))
_NAME, _LEGEND = 36, 62  # characters: of a name in a legend, of a legend's row below one panel
_BELOW = 0.45  # inches from a panel to its legend: the height of numbers and label
_FEW = 12  # points so few that each is marked


def draw(
    paths: Sequence[Path], metric: str, output: Path, statistic: Statistic = "iqm"
) -> tuple[Path, Path]:
    """Draws learning curves and writes the plotted numbers beside them.

    Args:
        paths: Run directories.
        metric: "return" or "length" of the evaluations, or a column of `metrics.parquet`.
        output: File to write, .png, .svg or .pdf.
        statistic: What the thick line is, over seeds.

    Returns:
        The picture and the table: `output`, and a .csv with the same stem.

    Raises:
        ValueError: A directory that is not a run, or that lacks the metric; nothing was written.
    """
    curves = [read(path, metric) for path in dict.fromkeys(paths)]
    bands = [
        estimate(curve.values[:, curve.kept], statistic, num_resamples=BAND_RESAMPLES)
        for curve in curves
    ]
    table = io.BytesIO()
    _table(curves, bands, statistic).write_csv(table)
    beside = output.with_suffix(".csv")
    with style():
        drawn = _figure(curves, bands, statistic)
        save(drawn, output.parent, output.stem, (output.suffix.removeprefix("."),))
    write_atomically(beside, lambda file: file.write(table.getbuffer()))
    return output, beside


def _figure(curves: list[Curve], bands: list[Estimate], statistic: Statistic) -> Figure:
    worlds = list(dict.fromkeys(curve.environment for curve in curves))
    lines = _lines(curves)
    num_columns = min(len(worlds), 3)
    num_rows = -(-len(worlds) // num_columns)
    tallest = max(sum(curve.environment == world for curve in curves) for world in worlds)
    height = (3.6 + 0.17 * tallest) * num_rows + 0.5
    figure = new_figure(6.4 if num_columns == 1 else 4.6 * num_columns, height)
    panels = figure.subplots(num_rows, num_columns, squeeze=False)
    for axis in panels.flat[len(worlds) :]:
        axis.set_visible(False)
    for axis, world in zip(panels.flat, worlds, strict=False):
        here = [i for i, curve in enumerate(curves) if curve.environment == world]
        _panel(axis, [(curves[i], bands[i], lines[i]) for i in here], statistic)
        axis.set_title(_shortened(world))
    figure.suptitle(_title(curves, statistic), fontsize=10)
    return figure


def _panel(
    axis: Axes, drawn: list[tuple[Curve, Estimate, dict[str, Any]]], statistic: Statistic
) -> None:
    """The runs in one environment; what lost seeds did does not set the scale."""
    last = max(int(curve.steps[-1]) for curve, _, _ in drawn)
    scale, words = next((scale, words) for least, scale, words in _SCALES if last >= least)
    for curve, band, line in drawn:
        _curve(axis, curve, band, line, curve.steps / scale, min(1.0, 4 / len(drawn)))
    axis.autoscale_view()
    limits = axis.get_ylim()
    for curve, _, line in drawn:
        lost = np.where(np.isfinite(curve.values), curve.values, np.nan)[:, ~curve.kept]
        axis.plot(curve.steps / scale, lost, color=line["color"], linewidth=0.8, linestyle=":")
    if any(curve.num_kept for curve, _, _ in drawn):
        axis.set_ylim(*limits)
    metric = drawn[0][0].metric
    axis.set_ylabel(_UNITS.get(metric, metric))
    axis.set_axisbelow(True)
    axis.set_xlabel(f"environment steps{words}")
    _legend(axis, [(line, _words(curve, line, statistic)) for curve, _, line in drawn])


def _curve(
    axis: Axes, curve: Curve, band: Estimate, line: dict[str, Any], steps: np.ndarray, ink: float
) -> None:
    """Each seed that stayed finite, the band, the statistic; the more runs, the less ink."""
    colour, alone = line["color"], len(steps) == 1
    if curve.num_kept > 1:
        thin = {
            "color": colour,
            "linewidth": 0.6,
            "alpha": ink * max(0.2, 0.6 - curve.num_kept / 50),
        }
        seeds = curve.values[:, curve.kept]
        axis.plot(steps, seeds, marker="_" if alone else "", zorder=1, **thin)
    axis.fill_between(
        steps, band.low, band.high, color=colour, alpha=0.2 * ink, linewidth=6 if alone else 0
    )
    marker = "o" if len(steps) <= _FEW else ""
    axis.plot(steps, band.value, marker=marker, markersize=3.5, **line)


def _legend(axis: Axes, entries: list[tuple[dict[str, Any], str]]) -> None:
    """Below the panel, where it hides nothing."""
    handles = [Line2D([], [], **{**line, "label": words}) for line, words in entries]
    inches = axis.figure.dpi_scale_trans
    longest = max(len(words) for _, words in entries)
    num_columns = max(1, min(len(entries), _LEGEND // (longest + 6)))
    axis.legend(
        handles=handles,
        loc="upper center",
        bbox_to_anchor=(0.5, 0),
        bbox_transform=axis.transAxes + ScaledTranslation(0, -_BELOW, inches),
        ncols=num_columns,
        frameon=False,
        handlelength=2.6,
    )


def _lines(curves: list[Curve]) -> list[dict[str, Any]]:
    """Name and look of each run's line: a name has one look in all panels."""
    names = _names(curves)
    looks = {name: i for i, name in enumerate(dict.fromkeys(names))}
    return [
        {
            "label": name,
            "color": _COLOURS[looks[name] % len(_COLOURS)],
            "linestyle": _DASHES[looks[name] % len(_DASHES)],
            "linewidth": 1.8,
        }
        for name in names
    ]


def _names(curves: list[Curve]) -> list[str]:
    """The algorithm; the folder too where two runs in an environment share it."""
    pairs = [(curve.environment, curve.algorithm) for curve in curves]
    shared = [i for i, pair in enumerate(pairs) if pairs.count(pair) > 1]
    folders = [curves[i].path.resolve().name for i in shared]
    if len(set(folders)) < len(folders):
        folders = [str(curves[i].path) for i in shared]
    names = [curve.algorithm for curve in curves]
    for i, folder in zip(shared, _telling(folders), strict=True):
        names[i] = f"{names[i]}, {folder}"
    return names


def _telling(folders: list[str]) -> list[str]:
    """Names that fit; of several long ones, the words that they begin and end with alike go."""
    long = {name: re.split(r"(?<=[-_/])", name) for name in folders if len(name) > _NAME}
    start = end = 0
    if len(long) > 1:
        end = _alike([words[::-1] for words in long.values()])
        # One word more: 0.003 alone does not say of what.
        start = max(0, _alike(list(long.values())) - 1)
    for name, words in long.items():
        middle = "".join(words[start : len(words) - end]).strip("-_/")
        long[name] = [*["…"] * (start > 0), middle, *["…"] * (end > 0)]
    return [_shortened("".join(long.get(name, name))) for name in folders]


def _alike(names: list[list[str]]) -> int:
    """With how many words all of some names begin alike; the last word of none is counted."""
    heads = zip(*(words[:-1] for words in names))
    return len(list(itertools.takewhile(lambda words: len(set(words)) == 1, heads)))


def _words(curve: Curve, line: dict[str, Any], statistic: Statistic) -> str:
    """What stands in the legend: the name, and over how many seeds the line goes."""
    kept, lost = curve.num_kept, curve.num_seeds - curve.num_kept
    alone = "1 seed, no interval" if kept else "no finite seed"
    seeds = f"{_WORDS[statistic]} of {kept} seeds" if kept > 1 else alone
    left_out = f"; {lost} left out, not finite" if kept and lost else ""
    return f"{line['label']} ({seeds}{left_out})"


def _title(curves: list[Curve], statistic: Statistic) -> str:
    thick = f"thick: {_WORDS[statistic]} over seeds, with its 95% bootstrap interval"
    words = f"{thick}; thin: each seed"
    if all(curve.num_kept < 2 for curve in curves):
        words = "one seed each: no interval" if len(curves) > 1 else "one seed: no interval"
    dotted = any(curve.num_kept < curve.num_seeds for curve in curves)
    lost = "\ndotted: seeds that did not stay finite, left out" if dotted else ""
    return f"{words[0].upper()}{words[1:]}{lost}"


def _shortened(name: str) -> str:
    """Both ends of a long name."""
    half = _NAME // 2
    return name if len(name) <= _NAME else f"{name[: half - 1]}…{name[-half:]}"


def _table(curves: list[Curve], bands: list[Estimate], statistic: Statistic) -> pl.DataFrame:
    """The plotted numbers: first the thick line, then each seed's; an empty cell for no number."""
    parts = []
    for curve, band in zip(curves, bands, strict=True):
        rows = {statistic: (None, band.value, band.low, band.high)}
        none = np.full(len(curve.steps), np.nan)
        seeds = zip(curve.seeds.tolist(), curve.values.T, strict=True)
        rows |= {f"seed {seed}": (seed, values, none, none) for seed, values in seeds}
        for line, (seed, value, low, high) in rows.items():
            columns = {"step": curve.steps, "value": value, "low": low, "high": high}
            same = {
                "environment": curve.environment,
                "algorithm": curve.algorithm,
                "run": str(curve.path),
                "metric": curve.metric,
                "line": line.split()[0],
                "seed": seed,
                "seeds": curve.num_kept if seed is None else 1,
            }
            constants = [pl.lit(entry).alias(name) for name, entry in same.items()]
            parts.append(pl.DataFrame(columns).fill_nan(None).select(*constants, *columns))
    return pl.concat(parts, how="vertical_relaxed")
