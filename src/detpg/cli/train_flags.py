"""The flags of `detpg train`: those of every run, and each algorithm's own from its registry."""

import dataclasses
import typing
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

# Flag -> type and help. What is not given is the setting file's, or the default named here.
COMMON: dict[str, tuple[Any, str]] = {
    "steps": (int, "Environment steps of each learner (default: 100000)."),
    "seeds": (int, "Learners side by side, each with a seed of its own (default: 1)."),
    "seed": (int, "Of everything random (default: 0)."),
    "policy": (
        str,
        "mu_theta: mlp, linear, quadratic, tiles, or FILE.py:NAME for one of your own (default: "
        "mlp; quadratic where the policy is a Gaussian on features).",
    ),
    "hidden": (
        tuple[int, ...],
        "Units of each hidden layer of a network (default: 32; 128 128 for ddpg and td3).",
    ),
    "value": (
        Literal["mlp", "quadratic", "tiles"],
        "The critic's function (default: mlp).",
    ),
    "value-units": (int, "Hidden units of a critic that is a network (default: 40)."),
    "norm": (
        Literal["none", "first", "all"],
        "LayerNorm in the critics of ddpg and td3: none, after the first layer (with a tanh) or in "
        "all (default: first).",
    ),
    "tiles": (int, "Tiles along each dimension, of tile-coded parts (default: 8)."),
    "tilings": (int, "Tilings of tile-coded parts (default: 8)."),
    "hashed": (
        int,
        "Weights that the tiles of a part share, such as 65536 where many numbers are observed "
        "(default: each tile has its own).",
    ),
    "normalise": (
        Literal["none", "observations", "rewards", "both"],
        "What is brought to a spread of 1 while learning (default: observations; both for ddpg and "
        "td3).",
    ),
    "num-envs": (int, "Worlds of each learner, of a Gymnasium environment (default: 1)."),
    "time-limit": (int, "Steps after which an episode is cut (default: the environment's)."),
    "evaluate-every": (int, "Steps between evaluations without noise (default: 5000)."),
    "evaluation-episodes": (
        int,
        "Episodes of each evaluation; 0: none, the last policy is the best (default: 10).",
    ),
    "judge-in-same-world": (
        bool,
        "Evaluate in the world that trains, between its episodes: where only one can be open.",
    ),
    "checkpoint-every": (int, "Steps between checkpoints (default: 5000)."),
    "log-every": (int, "Steps between rows of the metrics (default: 1000)."),
}
FILES: dict[str, tuple[Any, str]] = {
    "data": (
        str,
        "Parquet file or Minari data set of transitions to learn from, instead of acting.",
    ),
    "environment-option": (
        tuple[str, ...],
        "NAME=VALUE of the environment, such as g=9.81; several may follow.",
    ),
    "config": (
        Path,
        "TOML or JSON file of settings, or `tuned` for those known to learn the environment; flags "
        "win over it.",
    ),
    "output": (Path, "Run directory (default: runs/ALGORITHM-ENVIRONMENT)."),
}


def algorithms(run: Callable[[Any], None]) -> Any:
    """One sub-command for each algorithm of the registry, with all its hyper-parameters as flags.

    Args:
        run: What a sub-command does.
    """
    from detpg.algorithms import ALGORITHMS

    kinds = [
        Annotated[_flags(name, kind, run), tyro.conf.subcommand(name, prefix_name=False)]
        for name, kind in ALGORITHMS.items()
    ]
    return typing.Union[tuple(kinds)]  # noqa: UP007  (made of a list)


def _flags(name: str, kind: Any, run: Callable[[Any], None]) -> type:
    fields = [
        (
            "environment",
            Annotated[
                tyro.conf.Positional[str | None],
                tyro.conf.arg(
                    metavar="[ENVIRONMENT]",
                    help="Gymnasium id such as Pendulum-v1, or one of `detpg list`.",
                    help_behavior_hint="",
                ),
            ],
            None,
        )
    ]
    for flag, (type_, words) in (_own(kind) | COMMON | FILES).items():
        fields.append((flag.replace("-", "_"), _flag(type_, words), _unset(type_)))
    made = dataclasses.make_dataclass(
        "".join(part.title() for part in name.split("-")),
        [(field, type_, dataclasses.field(default=default)) for field, type_, default in fields],
        frozen=True,
        namespace={"run": run, "algorithm": name},
    )
    made.__doc__ = f"{(kind.__doc__ or '').strip().splitlines()[0]}"
    return made


def _own(kind: Any) -> dict[str, tuple[Any, str]]:
    """The algorithm's own: numbers from `hyper`, switches from `switch`."""
    from detpg.types import Width, hyper_parameters, switches

    types = {field.name: field.type for field in dataclasses.fields(kind)}
    flags: dict[str, tuple[Any, str]] = {}
    for name, known in hyper_parameters(kind).items():
        type_ = tuple[float, ...] if types[name] is Width else float
        default = "the environment's" if name == "gamma" else f"{known.default:g}"
        flags[name] = (type_, _help(known.doc, default))
    for name, field in switches(kind).items():
        flags[name] = (field.type, _help(field.metadata["switch"], field.default))
    return flags


def _help(doc: str, default: Any) -> str:
    return f"{doc[:1].upper()}{doc[1:]} (default: {default})."


def _unset(type_: Any) -> Any:
    return False if type_ is bool else None


def _flag(type_: Any, words: str) -> Any:
    about = tyro.conf.arg(help=words, help_behavior_hint="", metavar=_metavar(type_))
    return Annotated[type_ if type_ is bool else type_ | None, about]


def _metavar(type_: Any) -> str | None:
    if typing.get_origin(type_) is Literal:
        return "{" + ",".join(typing.get_args(type_)) + "}"
    return {
        int: "N",
        float: "X",
        str: "NAME",
        Path: "PATH",
        tuple[int, ...]: "N [N ...]",
        tuple[float, ...]: "X [X ...]",
        tuple[str, ...]: "NAME=VALUE ...",
    }.get(type_)
