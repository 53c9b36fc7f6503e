"""`detpg train` and `detpg resume`: one's own problem, from a command line to a policy."""

import dataclasses
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from detpg.cli import hints
from detpg.cli.errors import UserError
from detpg.cli.opened import OwnEnvironment, OwnPolicy, environment_options

if TYPE_CHECKING:
    from detpg.workbench.config import Config
    from detpg.workbench.run import Progress


@dataclasses.dataclass(frozen=True)
class Train:
    """Trains an algorithm in an environment, or on logged data, into a run directory.

    `detpg train ALGORITHM --help` lists its hyper-parameters. The same command continues a run
    that was stopped.
    """

    def run(self) -> None:
        """Is replaced by the sub-command of the algorithm."""
        raise UserError("no algorithm is named: choose one of `detpg list`.")


def train_command() -> Any:
    """A sub-command for each algorithm; made when it is called, for the registry imports JAX."""
    from detpg.cli.train_flags import algorithms

    return algorithms(_train)


@dataclasses.dataclass(frozen=True)
class Resume:
    """Continues a run that was stopped, or one that is finished for more steps."""

    path: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="RUN")]
    """Run directory."""

    steps: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """Environment steps in all (default: as many as before)."""

    own_policy: OwnPolicy = None
    """Policy of your own, if the run was trained with one: code is never loaded from a run."""

    own_environment: OwnEnvironment = None
    """The run's environment, if it is one of your own that a module registers."""

    def run(self) -> None:
        """Continues.

        Raises:
            UserError: No run, or one that cannot be continued.
        """
        from detpg.runs import RunDirectoryError
        from detpg.workbench.config import Config
        from detpg.workbench.folder import found_config

        try:
            found = found_config(self.path)
        except RunDirectoryError as error:
            raise UserError(str(error)) from error
        if found is None:
            raise UserError(f"{self.path} is no run of `detpg train`: name its folder.")
        try:
            config = Config.from_json(found["run"])
            steps = config.steps if self.steps is None else self.steps
            config = dataclasses.replace(config, steps=steps)
        except (TypeError, ValueError) as error:
            raise UserError(f"{self.path} cannot be continued: {error}") from error
        _go(config, self.path, self.own_policy, self.own_environment)


def _train(command: Any) -> None:
    """What the sub-command of an algorithm does."""
    from detpg.workbench.config import Config

    try:
        config = Config.from_json({"algorithm": command.algorithm, **_settings(command)})
    except (TypeError, ValueError) as error:
        raise UserError(str(error)) from error
    if command.config is None and _knows(config.environment, config.algorithm):
        print("settings that are known to learn this environment: --config tuned", file=sys.stderr)
    world = (config.environment or Path(str(config.data)).stem).replace("/", "-")
    path = command.output or Path("runs") / f"{config.algorithm}-{world}"
    own = config.policy if ".py:" in config.policy else None
    if own is not None and command.policy is None:
        raise UserError(
            f"{command.config} names a policy of your own, {own}: name it again with --policy; "
            "code is never loaded because a file says so."
        )
    if command.environment is None and ":" in str(config.environment):
        again = hints.typed("train", config.algorithm, config.environment)
        raise UserError(
            f"{command.config} names an environment of your own, {config.environment}: name it "
            f"again, {again} ...; code is never loaded because a file says so."
        )
    _go(config, path, own, command.environment)


def _settings(command: Any) -> dict[str, Any]:
    """Settings of the file, and over them the flags."""
    from detpg.algorithms import ALGORITHMS
    from detpg.types import hyper_parameters, switches
    from detpg.workbench.config import TUNED, read_settings

    kind = ALGORITHMS[command.algorithm]
    of_algorithm = {*hyper_parameters(kind), *switches(kind)}
    path = _tuned(command) if str(command.config) == TUNED else command.config
    found = read_settings(path, command.algorithm) if path else {}
    options = {**found.pop("options", {})}
    options |= {name: found.pop(name) for name in list(found) if name in of_algorithm}
    found.pop("algorithm", None)
    for field in dataclasses.fields(command):
        value = getattr(command, field.name)
        if value is None or value is False or field.name in ("config", "output"):
            continue
        if field.name in of_algorithm:
            single = isinstance(value, tuple) and len(value) == 1
            options[field.name] = value[0] if single else value
        elif field.name == "environment_option":
            found["environment_options"] = environment_options(value)
        else:
            found[field.name] = value
    return {**found, "options": options}


def _knows(environment: str | None, algorithm: str) -> bool:
    from detpg.workbench.config import tuned

    return algorithm in tuned(environment)[1]


def _tuned(command: Any) -> Path:
    """The settings that are known for the environment and the algorithm.

    Raises:
        UserError: There are none; names what there is.
    """
    from detpg.workbench.config import SETTINGS, tuned

    path, known = tuned(command.environment)
    if path is not None and command.algorithm in known:
        return path
    worlds = ", ".join(sorted(found.stem for found in SETTINGS.glob("*.toml")))
    what = f"for {', '.join(known)} in {command.environment}" if known else f"in {worlds}"
    raise UserError(
        f"--config tuned knows nothing for {command.algorithm} in {command.environment}, only "
        f"{what}: leave it out and set the step sizes."
    )


def _go(config: "Config", path: Path, own: str | None, environment: str | None) -> None:
    from detpg.runs import RunDirectoryError
    from detpg.workbench.diagnosis import DivergedError
    from detpg.workbench.own import import_module_of
    from detpg.workbench.run import train_in
    from detpg.world_error import WorldError

    stop = _Stop()
    try:
        import_module_of(environment)  # what was typed, not what a file names
        with _Shown(config, path) as shown, stop.listening():
            told = {"started": shown.started, "report": shown.show, "should_stop": stop.asked}
            ended = train_in(path, config, own=own, **told)
    except (RunDirectoryError, DivergedError, WorldError, ValueError) as error:
        raise UserError(str(error)) from error
    if not ended.finished:
        print(f"stopped at step {ended.step:,}; continue with: {hints.resume(path, config, own)}")
        raise SystemExit(130)
    print(f"done: {ended.step:,} steps in {path}")
    for aim, command in hints.after(path, config, own).items():
        print(f"  {aim:<7} {command}")


class _Stop:
    """Ctrl-C: the first ends the run after the interval at hand, the second at once."""

    def __init__(self) -> None:
        self._asked = False

    def asked(self) -> bool:
        return self._asked

    @contextmanager
    def listening(self) -> Iterator[None]:
        def handle(number: int, frame: Any) -> None:
            if self._asked:
                raise KeyboardInterrupt
            self._asked = True

        numbers = signal.SIGINT, signal.SIGTERM
        before = {number: signal.signal(number, handle) for number in numbers}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)


class _Shown:
    """A bar on a terminal; elsewhere a plain line for each tenth of the run."""

    def __init__(self, config: "Config", path: Path):
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            Progress,
            TaskProgressColumn,
            TextColumn,
            TimeRemainingColumn,
        )

        self._console, self._tenth = Console(stderr=True), -1
        self._words = f"{config.algorithm} in {config.environment or config.data}, into {path}"
        self._bars = Progress(
            TextColumn("{task.fields[steps]}"),
            BarColumn(),
            TaskProgressColumn(),
            TextColumn("{task.fields[speed]}"),
            TimeRemainingColumn(),
            TextColumn("{task.fields[earned]}"),
            console=self._console,
            disable=not self._console.is_terminal,
        )
        self._task = self._bars.add_task(
            "", total=config.steps, steps="compiling", speed="", earned=""
        )

    def __enter__(self) -> "_Shown":
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()

    def started(self) -> None:
        """Called once the run is known to be possible."""
        self._console.print(self._words, highlight=False, markup=False)

    def show(self, progress: "Progress") -> None:
        """Called after every interval."""
        for message in progress.messages:
            self._console.print(message, highlight=False, markup=False)
        steps, speed = f"{progress.step:,} steps", f"{progress.rate:,.0f} steps/s"
        earned = "" if progress.returned is None else f"return {progress.returned:,.1f}"
        self._bars.update(
            self._task, completed=progress.step, steps=steps, speed=speed, earned=earned
        )
        tenth = progress.step * 10 // progress.steps
        if not self._console.is_terminal and tenth != self._tenth:
            self._tenth = tenth
            share, left = progress.step / progress.steps, progress.seconds_left
            words = f"{steps} ({share:.0%}), {speed}, {left:,.0f} s left"
            self._console.print(", ".join(filter(None, (words, earned))), highlight=False)
