"""The folder of a run: entered by one process, refused where it holds another run."""

import contextlib
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from detpg.runs import (
    MARK,
    Checkpoints,
    RunDirectoryError,
    locked,
    provenance,
    write_atomically,
    write_json,
)
from detpg.types import Bounds, EnvironmentSpec
from detpg.version import __version__
from detpg.workbench.config import Config
from detpg.world_error import WorldError

CONFIG, CHECKPOINTS = "config.json", "checkpoints"


@contextlib.contextmanager
def opened(path: Path, config: Config, spec: EnvironmentSpec, bounds: Bounds) -> Iterator[None]:
    """Makes the folder of a run, or enters it if it holds this one; nobody else may.

    Raises:
        RunDirectoryError: It holds another run or a longer one, or somebody else is there.
    """
    found, new = found_config(path), [p for p in (path, *path.parents) if not p.exists()]
    own = {MARK: __version__, **config.identity}
    if found is not None:
        try:
            before = {MARK: found[MARK], **Config.from_json(found["run"]).identity}
        except (TypeError, ValueError) as error:
            raise RunDirectoryError(f"{path}/{CONFIG} is damaged ({error})") from error
        different = [name for name in own if own[name] != before[name]]
        if different:
            raise RunDirectoryError(
                f"{path} holds another run (different: {', '.join(different)}): choose another "
                "--output."
            )
    reached = Checkpoints(path / CHECKPOINTS).steps
    if reached and config.steps < reached[-1]:
        raise RunDirectoryError(
            f"--steps {config.steps} lies behind step {reached[-1]}, which {path} has reached: "
            "give as many or more."
        )
    path.mkdir(parents=True, exist_ok=True)
    try:
        with locked(path):
            _describe(path, config, spec, bounds, is_new=found is None)
            yield
    except (ValueError, WorldError):
        # What cannot be learnt at all must not stand in the way of the command that can.
        if found is None and not Checkpoints(path / CHECKPOINTS).steps:
            _take_back(path, new)
        raise


def _describe(
    path: Path, config: Config, spec: EnvironmentSpec, bounds: Bounds, is_new: bool
) -> None:
    """What the run is, before its first step."""
    content = {
        MARK: __version__,
        "algorithm": config.algorithm,
        "environment": config.environment or config.data,
        "seeds": config.seeds,
        "run": config.as_json(),
        "spec": spec_json(spec, bounds),
    }
    write_json(path / CONFIG, content)
    if is_new:
        about = provenance(config.as_json())
        write_json(path / "provenance.json", about)
        words = about["command"] + "\n"
        write_atomically(path / "command.txt", lambda file: file.write(words.encode()))


def _take_back(path: Path, new: list[Path]) -> None:
    """Removes what a run without a step has written, and the folders that were made for it."""
    for entry in [entry for entry in path.iterdir() if entry.name[0] != "."]:
        if entry.is_dir():
            shutil.rmtree(entry)
        else:
            entry.unlink()
    for folder in new:
        with contextlib.suppress(OSError):  # somebody else's is in it by now
            folder.rmdir()


def found_config(path: Path) -> dict[str, Any] | None:
    """What `config.json` of a run directory holds; None where the directory is new or empty.

    Raises:
        RunDirectoryError: It holds something else.
    """
    try:
        found = json.loads((path / CONFIG).read_text())
        if found[MARK] and isinstance(found["run"], dict) and isinstance(found["spec"], dict):
            return found
    except FileNotFoundError:
        if not path.exists() or not any(entry.name[0] != "." for entry in path.iterdir()):
            return None
    except (OSError, ValueError, KeyError, TypeError):
        pass
    raise RunDirectoryError(f"{path} is no run of `detpg train`: name another folder.")


def spec_json(spec: EnvironmentSpec, bounds: Bounds) -> dict[str, Any]:
    """The world's sizes and bounds as JSON types; infinite bounds as words."""
    return {
        "name": spec.name,
        "observation_size": spec.observation_size,
        "action_size": spec.action_size,
        "action_low": [str(x) for x in bounds.low],
        "action_high": [str(x) for x in bounds.high],
        "time_limit": spec.time_limit,
        "discount": spec.discount,
        "observation_low": [str(x) for x in spec.observation_low],
        "observation_high": [str(x) for x in spec.observation_high],
    }
