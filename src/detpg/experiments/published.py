"""The points of the paper's figures, recovered from its vector graphics."""

import csv
import importlib.resources

import numpy as np

SOURCE = "Silver et al. (2014)"


def published_curve(
    figure: str, panel: str, series: str, columns: tuple[str, ...] = ("x", "y")
) -> tuple[np.ndarray, ...]:
    """One plotted curve.

    Args:
        figure: "figure1" and the like.
        panel: "m=10", "pendulum" and the like.
        series: Label in the paper's legend.
        columns: What is wanted; figure 2 also has "low" and "high", one standard error around y.

    Returns:
        Each column as plotted, shape (points,).

    Raises:
        KeyError: There is no such curve.
    """
    data = importlib.resources.files("detpg.experiments") / "data" / f"{figure}.csv"
    lines = csv.DictReader(data.read_text().splitlines())
    rows = [r for r in lines if (r["panel"], r["series"]) == (panel, series)]
    if not rows:
        raise KeyError(f"no published curve {panel!r}, {series!r} in {figure}")
    return tuple(np.array([float(row[column]) for row in rows]) for column in columns)


def published_value(figure: str, panel: str, series: str, x: float, num_points: int = 1) -> float:
    """Mean of the last plotted points up to x, which itself may be rounded by a step.

    Args:
        figure: "figure1".
        panel: "m=10" and the like.
        series: Label in the paper's legend.
        x: Environment steps.
        num_points: How many points.
    """
    at, values = published_curve(figure, panel, series)
    last = int(np.argmin(np.abs(at - x)))
    return float(values[last - num_points + 1 : last + 1].mean())
