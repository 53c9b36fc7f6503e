"""Entry point: parses the words, runs the command, turns what users can mend into one sentence."""

import contextlib
import functools
import os
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import tyro

from detpg.cli.check_env import CheckEnv
from detpg.cli.errors import UserError
from detpg.cli.evaluate import Evaluate
from detpg.cli.export import Export
from detpg.cli.json_output import json_alone
from detpg.cli.list_command import List
from detpg.cli.plot import Plot
from detpg.cli.render import Render
from detpg.cli.reproduce import Reproduce
from detpg.cli.train import Resume, Train, train_command
from detpg.cli.verify import Verify

ABOUT = "Deterministic policy gradients: the algorithms and experiments of Silver et al. (2014)."

Command: Any = (
    Annotated[Train, tyro.conf.subcommand("train")]
    | Annotated[Resume, tyro.conf.subcommand("resume")]
    | Annotated[Evaluate, tyro.conf.subcommand("evaluate")]
    | Annotated[Plot, tyro.conf.subcommand("plot")]
    | Annotated[Render, tyro.conf.subcommand("render")]
    | Annotated[Export, tyro.conf.subcommand("export")]
    | Annotated[CheckEnv, tyro.conf.subcommand("check-env")]
    | Annotated[Reproduce, tyro.conf.subcommand("reproduce")]
    | Annotated[Verify, tyro.conf.subcommand("verify")]
    | Annotated[List, tyro.conf.subcommand("list")]
)

CONTINUE = ("train", "resume", "reproduce")  # go on where they stood


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; never returns normally on an error.

    Args:
        arguments: Words after the command's name; those of the process when not given.
    """
    warnings.showwarning = _warn
    words = list(sys.argv[1:] if arguments is None else arguments)
    _prepare_jax()
    _find_own_modules()
    trains = words[:1] == ["train"]
    command = tyro.cli(
        train_command() if trains else Command,
        args=words[1:] if trains else words,
        prog="detpg train" if trains else "detpg",
        description=Train.__doc__ if trains else ABOUT,
        config=(tyro.conf.OmitArgPrefixes, tyro.conf.FlagCreatePairsOff),
    )
    try:
        asked = getattr(command, "json", False)
        with json_alone(for_good=arguments is None) if asked else contextlib.nullcontext():
            command.run()
    except UserError as error:
        print(f"detpg: {error}{_where_it_failed(error)}", file=sys.stderr)
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        again = "; run the same command again to continue" if words[0] in CONTINUE else ""
        print(f"detpg: stopped{again}.", file=sys.stderr)
        raise SystemExit(130) from None


def _where_it_failed(error: UserError) -> str:
    """How to see where a world of the user's failed, or that it is shown already."""
    from detpg.world_error import TRACEBACK, WorldError, show

    cause = error.__cause__
    if not isinstance(cause, WorldError) or cause.__cause__ is None:
        return ""
    shown = show(cause.__cause__)
    return "" if shown else f" (With {TRACEBACK}=1 before the command its traceback is shown.)"


def _warn(message: Warning | str, *_: object, **__: object) -> None:
    """A warning is a sentence as well, without the line of code that it came from."""
    _say_once(str(message))


@functools.cache
def _say_once(sentence: str) -> None:
    print(f"detpg: {sentence}", file=sys.stderr)


def _prepare_jax() -> None:
    """Settings that JAX reads when it is imported, here and in worker processes.

    One thread per process: XLA's shared thread pool can wait for itself for ever
    (docs/decisions/0008). Compiled programs are kept in the user's cache folder.
    """
    flag = "--xla_cpu_multi_thread_eigen=false"
    flags = os.environ.get("XLA_FLAGS", "")
    if "xla_cpu_multi_thread_eigen" not in flags:
        os.environ["XLA_FLAGS"] = f"{flags} {flag}".strip()
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(_cache_folder() / "jax"))
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.2")


def _find_own_modules() -> None:
    """An environment of one's own, `mine:World-v0`, lies where the command is called."""
    here = str(Path.cwd())
    if here not in sys.path and "" not in sys.path:
        sys.path.append(here)


def _cache_folder() -> Path:
    import platformdirs

    return Path(platformdirs.user_cache_dir("detpg"))
