"""One world as a `gymnasium.Env`."""

from typing import Any

import gymnasium
import jax
import numpy as np

from detpg.integrations.gymnasium.episodes import Episode, advance, begin
from detpg.integrations.gymnasium.parts import (
    PIXELS,
    RENDER_FPS,
    built,
    checked,
    checked_mode,
    draw,
    metadata_of,
    spaces_of,
    started,
)
from detpg.types import Environment

# At the edge, so that worlds of one shape share one compilation.
_begin, _advance = jax.jit(begin), jax.jit(advance)


class GymnasiumEnv(gymnasium.Env[np.ndarray, np.ndarray]):
    """An environment of this library as a `gymnasium.Env`.

    The time limit is the environment's own and gives `truncated`. Actions outside the box are what
    the environment makes of them: the paper's tasks cap them. All that is random follows from
    `reset(seed=...)`.

    Attributes:
        environment: What is inside.
        episode: Where it stands; None before the first reset.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  (as Gymnasium declares it)
        "render_modes": ["human", "rgb_array"],
        "render_fps": RENDER_FPS,
    }

    def __init__(
        self,
        environment: str | Environment,
        render_mode: str | None = None,
        **options: Any,
    ):
        """Builds an environment, or takes one's own.

        Args:
            environment: Name in `ENVIRONMENTS`, or a record.
            render_mode: "rgb_array", "human" (a window, drawn at each step) or None.
            **options: What the named environment is built with.

        Raises:
            ValueError: An unknown name or render mode, or options for what is built already.
        """
        self.environment = built(environment, options)
        self.metadata = metadata_of(self.environment, self.metadata)
        self.render_mode = checked_mode(render_mode, self.metadata)
        self.observation_space, self.action_space = spaces_of(self.environment)
        self.episode: Episode | None = None
        self._action: np.ndarray | None = None
        self._path: list[np.ndarray] = []
        self._window = _open_window(self.environment) if render_mode == "human" else None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        super().reset(seed=seed)
        self.episode, observation = _begin(self.environment, draw(self.np_random))
        self._action, self._path = None, []
        self._show()
        return np.array(observation), {}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        episode = started(self.episode)
        self._action = checked(action, self.action_space)
        self.episode, outcome = _advance(self.environment, episode, self._action)
        self._show()
        observation, reward, terminated, truncated = jax.device_get(outcome)
        return np.array(observation), float(reward), bool(terminated), bool(truncated), {}

    # Gymnasium types a frame as a bare type variable, which nothing concrete can stand for.
    def render(self) -> np.ndarray | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The picture as uint8, shape (480, 480, 3), in mode "rgb_array"; nothing otherwise."""
        if self.render_mode != "rgb_array":
            return None
        return self._picture()

    def close(self) -> None:
        if self._window is not None:
            self._window.close()

    def _picture(self) -> np.ndarray:
        from detpg.figures.frames import render

        state = started(self.episode).state
        return render(self.environment, state, PIXELS, self._action, self._path)

    def _show(self) -> None:
        """Notes where the octopus arm's tip is, for its trace, and shows the window if there is."""
        if self.render_mode is None:
            return
        from detpg.figures.frames import tip

        where = tip(self.environment, started(self.episode).state)
        if where is not None:
            self._path.append(where)
        if self._window is not None:
            self._window.show(self._picture(), 1 / RENDER_FPS)


def _open_window(environment: Environment) -> Any:
    from detpg.figures.window import Window

    return Window(environment.spec.name)
