"""What is the user's own: a controller, FILE.py:NAME; a module that registers an environment."""

import importlib
import importlib.util
import sys
from pathlib import Path
from typing import Any

from detpg.types import EnvironmentSpec, Policy
from detpg.workbench.config import Config


def own_policy(words: str, spec: EnvironmentSpec) -> Policy:
    """The policy that a file names: an object, or a function of the spec that builds one.

    This runs the user's file, so it is done only for what the user typed, never for what a run
    directory holds.

    Args:
        words: FILE.py:NAME.
        spec: Of the world, actions in units of the box.

    Raises:
        ValueError: No such file or name, or what it names is no policy.
    """
    file, _, name = words.rpartition(":")
    path = Path(file)
    if not path.is_file():
        raise ValueError(f"policy {words!r} cannot be loaded: there is no file {file!r}.")
    found = getattr(_loaded(path, words), name, None)
    if found is None:
        raise ValueError(f"policy {words!r} cannot be loaded: {file} has no {name!r}.")
    # A class has the methods too, but without an object.
    made = isinstance(found, Policy) and not isinstance(found, type)
    policy: Any = found if made else _built(found, words, spec)
    if not isinstance(policy, Policy):
        raise ValueError(
            f"{words} is no policy: give an object with init(key) and __call__(theta, "
            "observation), or a function of the environment's spec that returns one."
        )
    return policy


def needs_own(path: Path, config: Config) -> str:
    """What is said where a run's policy is the user's own and was not named again."""
    return (
        f"{path} was trained with a policy of your own, {config.policy}: name it again with "
        "--own-policy; code is never loaded from a run."
    )


def import_module_of(environment: str | None) -> None:
    """Imports the module of an id `module:Id-v0`, which registers it; only of what the user typed.

    Raises:
        ValueError: The module cannot be imported.
    """
    module, colon, _ = str(environment).rpartition(":")
    if not colon:
        return
    try:
        importlib.import_module(module)
    except Exception as error:  # whatever the user's own code raises
        raise ValueError(
            f"environment {environment!r} cannot be built: {type(error).__name__}: {error}."
        ) from error


def check_imported(environment: str | None) -> None:
    """Refuses an id whose module nobody has imported: a file that was read may not run code.

    Raises:
        ValueError: Says how to name it.
    """
    module, colon, _ = str(environment).rpartition(":")
    if colon and module not in sys.modules:
        raise ValueError(
            f"The environment {environment} would run the module {module}, but code is never "
            f"loaded because a file names it: name it again with --own-environment {environment}, "
            f"or in Python import {module} first."
        )


def _loaded(path: Path, words: str) -> Any:
    module_spec = importlib.util.spec_from_file_location(f"own_policy_{path.stem}", path)
    if module_spec is None or module_spec.loader is None:
        raise ValueError(f"policy {words!r} cannot be loaded: give a Python file.")
    module = importlib.util.module_from_spec(module_spec)
    sys.modules[module_spec.name] = module  # where dataclasses look for it
    try:
        module_spec.loader.exec_module(module)
    except Exception as error:  # whatever the user's own code raises
        raise ValueError(
            f"policy {words!r} cannot be loaded: {type(error).__name__}: {error}."
        ) from error
    return module


def _built(found: Any, words: str, spec: EnvironmentSpec) -> Any:
    if not callable(found):
        return found
    try:
        return found(spec)
    except Exception as error:  # whatever the user's own code raises
        raise ValueError(
            f"policy {words!r} cannot be built: {type(error).__name__}: {error}."
        ) from error
