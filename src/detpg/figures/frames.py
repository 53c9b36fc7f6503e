"""One picture of an environment in one state, as an array of pixels."""

from collections.abc import Callable, Iterator
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from detpg.environments import ScaledActions
from detpg.figures import octopus

GROUND, BODY, AIM = "0.35", "tab:blue", "tab:green"


def tip(environment: Any, state: Any) -> np.ndarray | None:
    """Where the octopus arm ends, x and y; None in another environment, which leaves no trace."""
    return octopus.tip(state) if environment.spec.name == "octopus-arm" else None


def render(
    environment: Any, state: Any, pixels: int = 240, action: Any = None, path: Any = ()
) -> np.ndarray:
    """The environment in a state: uint8, shape (pixels, pixels, 3), red, green, blue.

    Args:
        environment: One of those in FRAMES, or with its actions scaled.
        state: Of that environment.
        pixels: Height and width.
        action: What is done there, for pictures that show it: the octopus arm's muscles. In units
            of the environment that is given.
        path: Where the octopus arm's tip was before: x and y, the latest last.

    Raises:
        ValueError: An environment that has no picture.
    """
    if isinstance(environment, ScaledActions):
        if action is not None:
            action = environment.legal(jnp.asarray(action, dtype=float))
        environment = environment.environment
    name = environment.spec.name
    if name not in FRAMES:
        raise ValueError(f"{name!r} has no picture: choose one of {', '.join(FRAMES)}.")
    figure = Figure(figsize=(pixels / 100, pixels / 100), dpi=100)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    record = isinstance(state, eqx.Module)
    trace = {"path": path} if name == "octopus-arm" else {}
    state = state if record else np.asarray(state, dtype=float)
    FRAMES[name](axes, environment, state, action, **trace)
    canvas.draw()
    return np.array(canvas.buffer_rgba())[:, :, :3]


def film(
    environment: Any, states: Any, actions: Any, pixels: int = 480, last: bool = False
) -> Iterator[np.ndarray]:
    """A picture of each of some states; of the octopus arm with the path of its tip.

    Args:
        environment: One of those in FRAMES, or with its actions scaled.
        states: With a leading axis over time on every leaf.
        actions: The action taken in each state.
        pixels: Height and width.
        last: Only of the last one.
    """
    if isinstance(environment, ScaledActions):
        actions = jax.vmap(environment.legal)(jnp.asarray(actions, dtype=float))
        environment = environment.environment
    if environment.spec.name == "octopus-arm":
        yield from octopus.frames(environment, states, actions, pixels=pixels, last=last)
        return
    actions = np.asarray(actions)
    for step in range(len(actions) - 1 if last else 0, len(actions)):
        state = jax.tree.map(lambda leaf, at=step: leaf[at], states)
        yield render(environment, state, pixels, actions[step])


def _mountain_car(axes: Axes, environment: Any, state: np.ndarray, action: Any) -> None:
    spec = environment.spec
    low, high = spec.observation_low[0], spec.observation_high[0]
    slope, goal = float(environment.slope), float(environment.goal)
    p = np.linspace(low, high, 100)
    axes.plot(p, np.sin(slope * p), color=GROUND, linewidth=2)
    height = np.sin(slope * goal)
    axes.plot([goal, goal], [height, height + 0.3], color=AIM, linewidth=3)
    axes.plot([low, low], [np.sin(slope * low), 1.2], color=GROUND, linewidth=2)
    axes.plot(state[0], np.sin(slope * state[0]) + 0.08, "o", color=BODY, markersize=12)
    axes.set(xlim=(low - 0.05, high + 0.05), ylim=(-1.2, 1.4))


def _pendulum(axes: Axes, environment: Any, state: np.ndarray, action: Any) -> None:
    x, y = np.sin(state[0]), np.cos(state[0])
    axes.plot([0, x], [0, y], color=GROUND, linewidth=4, solid_capstyle="round")
    axes.add_patch(Circle((x, y), 0.12, color=BODY, zorder=3))
    axes.plot(0, 0, "o", color=GROUND, markersize=5)
    axes.plot([0, 0], [1.14, 1.2], color=AIM, linewidth=3)
    axes.set(xlim=(-1.25, 1.25), ylim=(-1.25, 1.25), aspect="equal")


def _puddle_world(axes: Axes, environment: Any, state: np.ndarray, action: Any) -> None:
    side = jnp.linspace(0.0, 1.0, 60)
    rooms = jnp.stack(jnp.meshgrid(side, side), axis=-1).reshape(-1, 2)
    reward = jax.vmap(environment.reward, in_axes=(None, None, 0))(rooms[0], rooms[0], rooms)
    depth = -np.asarray(reward).reshape(60, 60)
    axes.imshow(depth, origin="lower", extent=(0, 1, 0, 1), cmap="Blues", vmax=1.5 * depth.max())
    goal, reach = np.asarray(environment.goal), float(environment.reach)
    corners = reach * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
    axes.add_patch(Polygon(goal + corners, color=AIM))
    axes.plot(*state, "o", color="tab:red", markersize=7)
    axes.set(xlim=(0, 1), ylim=(0, 1))


FRAMES: dict[str, Callable[[Axes, Any, Any, Any], None]] = {
    "mountain-car": _mountain_car,
    "octopus-arm": octopus.paint,
    "pendulum": _pendulum,
    "puddle-world": _puddle_world,
}
