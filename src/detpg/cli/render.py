"""`detpg render`: an episode as a picture or a film."""

import dataclasses
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import tyro

from detpg.cli.errors import UserError
from detpg.cli.opened import POLICIES, OwnEnvironment, OwnPolicy, opened, told
from detpg.cli.outputs import check_writable, checked_kind, unwritable

if TYPE_CHECKING:
    import numpy as np

    from detpg.types import Environment

KINDS = ("mp4", "gif", "png")
MOST_STEPS = 10_000  # the film is held in memory, 0.7 MB a step
OF_ENVIRONMENT = ("random", "zero")
Act = Callable[[Any, Any], Any]  # step and state -> action


class Played(NamedTuple):
    """Pictures of an episode, or its last one, how many steps it had, and pictures a second."""

    pictures: "list[np.ndarray]"
    num_steps: int
    rate: float


@dataclasses.dataclass(frozen=True)
class Render:
    """Draws an episode: a film as mp4 or gif, or its last state as png.

    Of an environment of detpg, in which nothing that was learnt acts unless --policy names a file;
    or of a run of `detpg train`, whose policy acts in the run's environment.
    """

    what: Annotated[
        tyro.conf.Positional[str], tyro.conf.arg(name="what", metavar="ENVIRONMENT|RUN")
    ]
    """An environment such as octopus-arm (see `detpg list`), or the folder of a run."""

    output: Annotated[
        Path | None,
        tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: named after it, .mp4)"),
    ] = None
    """File to write, .mp4, .gif or .png; one that is there is replaced."""

    policy: Annotated[
        str | None,
        tyro.conf.arg(
            metavar="WHAT",
            help="What acts. In an environment: random (legal actions, each held for a while), "
            "zero, or in octopus-arm the policy.npz that a study of Figure 3 has kept, such as "
            "results/figure3/policy.npz. Of a run: best or last.",
            help_behavior_hint="(default: random; of a run: best)",
        ),
    ] = None

    index: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """Which training seed's policy, 0 the first (default: the best evaluated)."""

    own_policy: OwnPolicy = None
    """Policy of your own, if the run was trained with one: code is never loaded from a run."""

    own_environment: OwnEnvironment = None
    """The run's environment, if it is one of your own that a module registers."""

    steps: Annotated[
        int | None,
        tyro.conf.arg(metavar="N", help_behavior_hint="(default: 100; of what was learnt: 1000)"),
    ] = None
    """Steps to take, 1 to 10000; fewer if the episode ends."""

    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Of everything random in the episode, 0 to 2147483647."""

    hold: Annotated[int, tyro.conf.arg(metavar="N")] = 10
    """Steps for which a random action is held, 1 or more."""

    def run(self) -> None:
        """Plays the episode, then draws it.

        Raises:
            UserError: An environment, run, number or file that cannot be used; nothing was
                written.
        """
        output = self.output or Path(f"{Path(self.what).resolve().name}.mp4")
        kind = checked_kind(output, KINDS)
        self._check_numbers()
        film = self._film()
        check_writable(output)
        played = film(kind == "png")
        self._write(played, output, kind)
        print(f"written to {output}: {played.num_steps} steps")

    def _check_numbers(self) -> None:
        ranges = {"steps": (1, MOST_STEPS), "seed": (0, 2**31 - 1), "hold": (1, MOST_STEPS)}
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise UserError(f"--{name} {value} cannot be used: give {low} to {high}.")

    def _film(self) -> "Callable[[bool], Played]":
        """What plays and draws, once all that was named is known to be there."""
        from detpg.environments import ENVIRONMENTS

        if self.what in ENVIRONMENTS or not Path(self.what).is_dir():
            environment, act = self._in_environment()
            learnt = self.policy not in (None, *OF_ENVIRONMENT)
            return lambda last: self._own_film(environment, act, learnt, last)
        run, which = self._opened()
        environment = run.world
        if environment is None:
            return lambda last: self._foreign_film(run, which, last)
        _with_picture(environment.spec.name)
        with told():
            controller = run.controller(which, self.index)
        steered: Act = lambda step, state: controller(environment.observe(state))  # noqa: E731
        return lambda last: self._own_film(environment, steered, True, last)

    def _opened(self) -> tuple[Any, str]:
        """The run, and which of its policies acts."""
        which = self.policy or POLICIES[0]
        if which not in POLICIES:
            raise UserError(f"--policy {which} is not of a run: choose best or last.")
        run = opened(Path(self.what), which, self.own_policy, self.own_environment)
        if self.index is not None and not 0 <= self.index < run.config.seeds:
            raise UserError(
                f"--index {self.index} cannot be used: {self.what} has {run.config.seeds} "
                "training seeds, the first is 0."
            )
        return run, which

    def _in_environment(self) -> "tuple[Environment, Act]":
        """The named environment and what acts in it."""
        environment = _with_picture(self.what)
        policy = self.policy or OF_ENVIRONMENT[0]
        if policy in OF_ENVIRONMENT:
            return environment, self._untaught(environment, policy)
        if self.what != "octopus-arm" or not policy.endswith(".npz"):
            raise UserError(
                f"--policy {policy} cannot act in an environment: choose random, zero or, in "
                "octopus-arm, a file .npz; name a run's folder for what it has learnt."
            )
        from detpg.figures.figure3 import learnt

        with told():
            environment, mu, theta = learnt(Path(policy))
        return environment, lambda step, state: mu(theta, environment.observe(state))

    def _untaught(self, environment: "Environment", policy: str) -> Act:
        """Random actions, each held for a while, or none."""
        import jax
        import jax.numpy as jnp

        *_, action_key = self._keys()
        spec = environment.spec
        low, high = (jnp.asarray(bound, float) for bound in (spec.action_low, spec.action_high))

        def act(step: Any, state: Any) -> Any:
            if policy == "zero":
                return jnp.clip(jnp.zeros_like(low), low, high)
            key = jax.random.fold_in(action_key, step // self.hold)
            return jax.random.uniform(key, low.shape, low.dtype, low, high)

        return act

    def _keys(self) -> Any:
        """Keys of the start, of the environment's noise and of the random actions."""
        import jax

        return jax.random.split(jax.random.key(self.seed), 3)

    def _own_film(self, environment: "Environment", act: Act, learnt: bool, last: bool) -> "Played":
        """Pictures of an episode in an environment of detpg, or of its last state alone."""
        from detpg.figures.frames import film
        from detpg.integrations.gymnasium.parts import RENDER_FPS

        states, actions = self._played(environment, act, self.steps or (1000 if learnt else 100))
        pictures = list(film(environment, states, actions, last=last))
        return Played(pictures, len(actions) - 1, RENDER_FPS)

    def _foreign_film(self, run: Any, which: str, last: bool) -> "Played":
        """Pictures of an episode in a Gymnasium environment, by its own drawing."""
        # Drawn into memory: SDL, which draws Gymnasium's worlds, needs no screen.
        os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
        with told():
            film = run.film(which, self.index, self.seed, self.steps or 1000)
        pictures = film.frames[-1:] if last else film.frames
        return Played(pictures, len(film.frames) - 1, film.rate)

    def _played(self, environment: "Environment", act: Act, num_steps: int) -> tuple[Any, Any]:
        """States and the actions taken there, up to the state in which the episode ended."""
        import jax
        import jax.numpy as jnp
        import numpy as np

        start_key, loop_key, _ = self._keys()

        def body(state: Any, step: jax.Array) -> tuple[Any, Any]:
            action = act(step, state)
            next_state = environment.transition(jax.random.fold_in(loop_key, step), state, action)
            return next_state, (state, action, environment.terminated(state))

        steps = jnp.arange(min(num_steps, environment.spec.time_limit) + 1)
        start = environment.initial(start_key)
        _, (states, actions, terminated) = jax.jit(lambda: jax.lax.scan(body, start, steps))()
        over = np.flatnonzero(terminated)
        end = over[0] + 1 if len(over) else len(steps)
        return jax.tree.map(lambda leaf: leaf[:end], (states, actions))

    def _write(self, played: "Played", output: Path, kind: str) -> None:
        from detpg.figures.animation import animate
        from detpg.runs import write_atomically

        film_kind = "gif" if kind == "gif" else "mp4"
        pictures = played.pictures
        still = kind == "png"
        content = _png(pictures[0]) if still else animate(pictures, film_kind, played.rate)
        try:
            write_atomically(output, lambda file: file.write(content))
        except OSError as error:
            raise unwritable(output, error) from error


def _with_picture(name: str) -> "Environment":
    """An environment of detpg that can be drawn.

    Raises:
        UserError: There is none of that name, or it has no picture.
    """
    from detpg.environments import ENVIRONMENTS
    from detpg.figures.frames import FRAMES

    if name not in FRAMES:
        known = ", ".join(FRAMES)
        what = "has no picture" if name in ENVIRONMENTS else "is unknown"
        raise UserError(
            f"environment {name!r} {what}: choose from {known}, or name a run's folder."
        )
    return ENVIRONMENTS[name]()


def _png(picture: "np.ndarray") -> bytes:
    import io

    from PIL import Image

    content = io.BytesIO()
    Image.fromarray(picture).save(content, "png")
    return content.getvalue()
