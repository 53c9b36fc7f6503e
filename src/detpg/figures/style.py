"""The look of every picture, and how it is written to disk."""

import io
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from detpg.runs import write_atomically

PUBLISHED: dict[str, Any] = {"color": "0.62", "linewidth": 1.1, "zorder": 1}

_STYLE: Any = {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.labelsize": 9,
    "legend.fontsize": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "0.92",
    "grid.linewidth": 0.6,
    "svg.hashsalt": "detpg",
    "savefig.dpi": 160,
}


def new_figure(width: float, height: float) -> Figure:
    """An empty figure, inches; no window."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def style() -> AbstractContextManager[None]:
    """The style as a context: everything is drawn and saved inside it."""
    return mpl.rc_context(_STYLE)


def save(figure: Figure, directory: Path, name: str, formats: tuple[str, ...]) -> None:
    """Writes a figure in each format, whole or not at all, without dates in it."""
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # laid out once, not again for each format
    for kind in formats:
        content = io.BytesIO()
        metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
        figure.savefig(content, format=kind, metadata=metadata)
        path = directory / f"{name}.{kind}"
        write_atomically(path, lambda file, data=content: file.write(data.getbuffer()))
