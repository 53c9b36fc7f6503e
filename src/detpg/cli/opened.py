"""Runs that a command looks at."""

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import tyro

from detpg.cli import hints
from detpg.cli.errors import UserError

POLICIES = ("best", "last")
OwnPolicy = Annotated[
    str | None, tyro.conf.arg(metavar="FILE.py:NAME", help_behavior_hint="(default: none)")
]
OwnEnvironment = Annotated[
    str | None, tyro.conf.arg(metavar="MODULE:ID", help_behavior_hint="(default: none)")
]


def opened(path: Path, policy: str, own: str | None = None, environment: str | None = None) -> Any:
    """The run in a folder, one of whose policies is asked for.

    Args:
        path: The folder.
        policy: Which of its policies.
        own: Where the user's own policy stands, FILE.py:NAME.
        environment: The user's own environment, whose module is imported.

    Raises:
        UserError: No run, or one that has not kept that policy yet.
    """
    if not (path / "config.json").is_file():
        raise UserError(f"{path} is not a run: name a folder that `detpg train` has written.")
    with told():
        from detpg.workbench import open_run
        from detpg.workbench.own import import_module_of

        import_module_of(environment)
        run = open_run(path, own)
    if not (path / f"{policy}.npz").is_file():
        raise UserError(
            f"{path} has no {policy} policy yet: wait for its first evaluation, or continue it "
            f"with `{hints.resume(path, run.config, own)}`."
        )
    return run


def environment_options(words: tuple[str, ...]) -> dict[str, Any]:
    """What NAME=VALUE words say, a value as JSON where it is any, else as text.

    Raises:
        UserError: No such words.
    """
    options: dict[str, Any] = {}
    for given in words:
        name, equals, value = given.partition("=")
        if not (name and equals):
            raise UserError(f"--environment-option {given} cannot be used: give NAME=VALUE.")
        try:
            options[name] = json.loads(value)
        except ValueError:
            options[name] = value
    return options


@contextlib.contextmanager
def told() -> Iterator[None]:
    """Turns what a run or its world says that it cannot do into one sentence.

    Raises:
        UserError: Instead of what was raised.
    """
    import gymnasium

    from detpg.runs import RunDirectoryError
    from detpg.world_error import WorldError

    known = (ValueError, OSError, RunDirectoryError, WorldError, gymnasium.error.Error)
    try:
        yield
    except known as error:
        raise UserError(" ".join(str(error).split())) from error
