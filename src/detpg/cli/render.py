"""`detpg render`: an episode as a picture or a film."""

import dataclasses
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from detpg.cli.errors import UserError

if TYPE_CHECKING:
    from detpg.types import Environment

KINDS = ("mp4", "gif", "png")
MOST_STEPS = 10_000  # the film is held in memory, 0.7 MB a step


@dataclasses.dataclass(frozen=True)
class Render:
    """Draws an episode of an environment: a film as mp4 or gif, or its last state as png."""

    environment: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="ENVIRONMENT")]
    """Such as octopus-arm (see `detpg list`)."""

    output: Annotated[
        Path | None,
        tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: ENVIRONMENT.mp4)"),
    ] = None
    """File to write, .mp4, .gif or .png; one that is there is replaced."""

    steps: Annotated[int, tyro.conf.arg(metavar="N")] = 100
    """Steps to take, 1 to 10000; fewer if the episode ends."""

    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Of everything random, 0 to 2147483647."""

    policy: Literal["random", "zero"] = "random"
    """What acts: actions drawn from the legal ones, each held for a while, or none."""

    hold: Annotated[int, tyro.conf.arg(metavar="N")] = 10
    """Steps for which a random action is held, 1 or more."""

    def run(self) -> None:
        """Plays the episode, then draws it.

        Raises:
            UserError: An environment, number or file that cannot be used; nothing was written.
        """
        output = self.output or Path(f"{self.environment}.mp4")
        kind = output.suffix.removeprefix(".").lower()
        if kind not in KINDS:
            raise UserError(f"{output} is of no known kind: let it end with .mp4, .gif or .png.")
        self._check_numbers()
        environment = self._environment()
        _check_writable(output)
        states, actions = self._play(environment)
        self._write(environment, states, actions, output, kind)
        print(f"written to {output}: {len(actions) - 1} steps")

    def _check_numbers(self) -> None:
        ranges = {"steps": (1, MOST_STEPS), "seed": (0, 2**31 - 1), "hold": (1, MOST_STEPS)}
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise UserError(f"--{name} {value} cannot be used: give {low} to {high}.")

    def _environment(self) -> "Environment":
        from detpg.environments import ENVIRONMENTS
        from detpg.figures.frames import FRAMES

        if self.environment not in FRAMES:
            known = ", ".join(FRAMES)
            what = "has no picture" if self.environment in ENVIRONMENTS else "is unknown"
            raise UserError(f"environment {self.environment!r} {what}: choose from {known}.")
        return ENVIRONMENTS[self.environment]()

    def _play(self, environment: "Environment") -> tuple[Any, Any]:
        """States and the actions taken there, up to the state in which the episode ended."""
        import jax
        import jax.numpy as jnp
        import numpy as np

        start_key, loop_key, action_key = jax.random.split(jax.random.key(self.seed), 3)
        spec = environment.spec
        low, high = (jnp.asarray(bound, float) for bound in (spec.action_low, spec.action_high))

        def body(state: Any, step: jax.Array) -> tuple[Any, Any]:
            key = jax.random.fold_in(action_key, step // self.hold)
            action = jax.random.uniform(key, low.shape, low.dtype, low, high)
            if self.policy == "zero":
                action = jnp.clip(jnp.zeros_like(low), low, high)
            next_state = environment.transition(jax.random.fold_in(loop_key, step), state, action)
            return next_state, (state, action, environment.terminated(state))

        steps = jnp.arange(min(self.steps, spec.time_limit) + 1)
        start = environment.initial(start_key)
        _, (states, actions, terminated) = jax.jit(lambda: jax.lax.scan(body, start, steps))()
        over = np.flatnonzero(terminated)
        end = over[0] + 1 if len(over) else len(steps)
        return jax.tree.map(lambda leaf: leaf[:end], (states, actions))

    def _write(
        self, environment: "Environment", states: Any, actions: Any, output: Path, kind: str
    ) -> None:
        import jax

        from detpg.figures.frames import film
        from detpg.figures.octopus import animate
        from detpg.runs import write_atomically

        if kind == "png":
            last = slice(-1, None)
            states, actions = jax.tree.map(lambda leaf: leaf[last], (states, actions))
        pictures = list(film(environment, states, actions))
        film_kind = "gif" if kind == "gif" else "mp4"
        content = _png(pictures[0]) if kind == "png" else animate(pictures, film_kind)
        try:
            write_atomically(output, lambda file: file.write(content))
        except OSError as error:
            raise _unwritable(output, error) from error


def _png(picture: Any) -> bytes:
    import io

    from PIL import Image

    content = io.BytesIO()
    Image.fromarray(picture).save(content, "png")
    return content.getvalue()


def _check_writable(output: Path) -> None:
    """Before time is spent on what could not be kept."""
    try:
        if output.is_dir():
            raise IsADirectoryError(0, "is a folder")
        with tempfile.TemporaryFile(dir=output.parent):
            pass
    except OSError as error:
        raise _unwritable(output, error) from error


def _unwritable(output: Path, error: OSError) -> UserError:
    return UserError(f"{output} cannot be written to ({error.strerror}): choose another --output.")
