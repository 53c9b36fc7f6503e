"""The octopus arm in a picture or a film: muscles by activation, target, water, path of the tip."""

from collections.abc import Iterator
from typing import Any

import jax
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch

from detpg.environments import OctopusArm
from detpg.environments.octopus_arm import State
from detpg.environments.octopus_arm.body import body_of, nodes
from detpg.environments.octopus_arm.targets import reach
from detpg.figures.style import new_figure, style

SKIN, OUTLINE, BASE = "#f0d9d6", "#7d4f57", "#4d3540"
AIM, HIT, PATH = "#e08214", "#1b7837", "#2f6690"
WATER = LinearSegmentedColormap.from_list("water", ["#eef6fa", "#cfe2ee"])
SURFACE = "#7fb2cf"
MUSCLE = LinearSegmentedColormap.from_list("muscle", ["#c9a3a0", "#e2564a", "#8b0a1a"])


def figure(world: OctopusArm, state: State, action: Any = None, path: Any = ()) -> Figure:
    """The arm in one state, with axes and the scale of the activations.

    Args:
        world: The environment.
        state: One of its states.
        action: What the muscles and the base do; nothing when not given.
        path: Where the tip was before: x and y, the latest last.
    """
    with style():
        drawn = new_figure(7, 6)
        axes = drawn.add_subplot()
        paint(axes, world, state, action, path)
        axes.set(xlabel="x", ylabel="y")
        scale = ScalarMappable(Normalize(0, 1), MUSCLE)
        drawn.colorbar(scale, ax=axes, label="activation", shrink=0.5, aspect=20, pad=0.02)
        drawn.draw_without_rendering()
    return drawn


def frame(
    world: OctopusArm,
    state: State,
    action: Any = None,
    path: Any = (),
    *,
    pixels: int = 480,
    words: str = "",
) -> np.ndarray:
    """The arm in one state as red, green and blue: uint8, shape (pixels, pixels, 3).

    Args:
        world: The environment.
        state: One of its states.
        action: What the muscles and the base do; nothing when not given.
        path: Where the tip was before: x and y, the latest last.
        pixels: Height and width.
        words: What stands in the upper left corner.
    """
    drawn = Figure(figsize=(pixels / 100, pixels / 100), dpi=100)
    canvas = FigureCanvasAgg(drawn)
    axes = drawn.add_axes((0, 0, 1, 1))
    paint(axes, world, state, action, path)
    axes.set_axis_off()
    axes.text(0.03, 0.97, words, transform=axes.transAxes, va="top", fontsize=9, color="0.25")
    canvas.draw()
    return np.array(canvas.buffer_rgba())[:, :, :3]


def tip(state: State) -> np.ndarray:
    """The middle of the last two nodes, x and y."""
    x, y = (np.asarray(part, np.float64) for part in (state.arm.x, state.arm.y))
    return np.array([x[:, -1].mean(), y[:, -1].mean()])


def frames(
    world: OctopusArm, states: State, actions: Any, *, pixels: int = 480, last: bool = False
) -> Iterator[Any]:
    """A frame for each of some states, with the path of the tip so far.

    Args:
        world: The environment.
        states: A state with a leading axis over time on every leaf.
        actions: The action taken in each state.
        pixels: Height and width.
        last: Only of the last state.
    """
    path: list[np.ndarray] = []
    for step, action in enumerate(np.asarray(actions)):
        state = jax.tree.map(lambda leaf, at=step: leaf[at], states)
        path.append(tip(state))
        if not last or step == len(actions) - 1:
            yield frame(world, state, action, path, pixels=pixels, words=f"step {step}")


def paint(axes: Axes, world: OctopusArm, state: State, action: Any = None, path: Any = ()) -> None:
    """Draws arm, target and water into axes of equal scale."""
    body = body_of(world.parameters)
    x, y = (np.asarray(part, np.float64) for part in nodes(body, state.arm))
    upper, lower = np.stack([x, y], axis=-1)
    centre, target = (upper[0] + lower[0]) / 2, np.asarray(state.target, np.float64)
    action = np.zeros(world.spec.action_size) if action is None else np.asarray(action)
    dorsal, transversal, ventral = np.clip(action[2:], 0, 1).reshape(-1, 3).T

    half = max(0.95 * reach(world.parameters), float(np.hypot(*(target - centre))) + 0.5)
    axes.set(xlim=centre[0] + np.array([-half, half]), ylim=centre[1] + np.array([-half, half]))
    axes.grid(visible=False)
    _water(axes, float(world.parameters.surface_level))
    _path(axes, path)
    skin = np.stack([upper[:-1], upper[1:], lower[1:], lower[:-1]], axis=1)
    axes.add_collection(PolyCollection(list(skin), facecolor=SKIN, edgecolor=SKIN, zorder=3))
    # The picture shrinks with the reach, and so do the lines.
    width = 38 / half
    _muscles(axes, np.stack([upper[1:], lower[1:]], axis=1), transversal, width)
    _muscles(axes, np.stack([upper[:-1], upper[1:]], axis=1), dorsal, width)
    _muscles(axes, np.stack([lower[:-1], lower[1:]], axis=1), ventral, width)
    axes.plot(x[:, 1:].ravel(), y[:, 1:].ravel(), "o", color=OUTLINE, ms=0.65 * width, zorder=6)
    _base(axes, upper[0], lower[0], float(action[0] - action[1]), width)
    _target(axes, target, bool(world.terminated(state)), 0.03 * half)


def _water(axes: Axes, surface: float) -> None:
    """Darker with depth."""
    low, high = axes.get_ylim()
    if surface > low:
        span = (*axes.get_xlim(), low, min(surface, high))
        axes.imshow(np.linspace(0, 1, 256)[:, None], cmap=WATER, extent=span, zorder=0)
    if low < surface < high:
        axes.axhline(surface, color=SURFACE, linewidth=1.5, zorder=1)
    axes.set(ylim=(low, high), aspect="equal")


def _path(axes: Axes, path: Any) -> None:
    """The older, the fainter."""
    points = np.asarray(path, np.float64).reshape(-1, 2)
    if len(points) > 1:
        lines = np.stack([points[:-1], points[1:]], axis=1)
        alpha = np.linspace(0.1, 0.9, len(lines))
        axes.add_collection(
            LineCollection(list(lines), colors=PATH, alpha=alpha, linewidths=1.2, zorder=2)
        )


def _muscles(axes: Axes, edges: np.ndarray, on: np.ndarray, width: float) -> None:
    axes.add_collection(
        LineCollection(
            list(edges),
            colors=list(MUSCLE(on)),
            linewidths=list(width * (0.35 + 0.75 * on)),
            capstyle="round",
            zorder=4,
        )
    )


def _base(axes: Axes, upper: np.ndarray, lower: np.ndarray, torque: float, width: float) -> None:
    """The turning base, a mark on its upper node, an arrow for the torque."""
    centre, radius = (upper + lower) / 2, float(np.hypot(*(upper - lower))) / 2
    axes.add_patch(Circle(tuple(centre), radius, facecolor=BASE, edgecolor="none", zorder=5))
    axes.plot(*upper, "o", color="white", ms=0.8 * width, zorder=7)
    if torque:
        ends = centre + 1.7 * radius * np.array([[-0.5, 0.87], [-0.5, -0.87]])
        ends = ends if torque > 0 else ends[::-1]
        arrow = FancyArrowPatch(
            tuple(ends[0]),
            tuple(ends[1]),
            connectionstyle=f"arc3,rad={0.55 * np.sign(torque)}",
            arrowstyle="-|>",
            mutation_scale=2.2 * width,
            linewidth=0.5 * width * abs(torque),
            color=BASE,
            zorder=5,
        )
        axes.add_patch(arrow)


def _target(axes: Axes, target: np.ndarray, hit: bool, size: float) -> None:
    colour, place = HIT if hit else AIM, tuple(target)
    axes.add_patch(Circle(place, 2 * size, facecolor="none", edgecolor=colour, lw=1.6, zorder=8))
    axes.add_patch(Circle(place, size, facecolor=colour, edgecolor="white", lw=0.8, zorder=8))
