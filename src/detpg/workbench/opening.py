"""The worlds of a run on the host: those it is trained in, those it is judged in, kept apart."""

from collections.abc import Callable
from typing import Any

import gymnasium
from gymnasium.vector import VectorEnv, VectorWrapper

from detpg.integrations.gymnasium.batched import BatchedWorlds
from detpg.integrations.gymnasium.layers import copies, gathering, layers, shared
from detpg.integrations.gymnasium.plain import PlainWorlds
from detpg.workbench.config import Config
from detpg.world_error import WorldError

IN_THE_SAME = (
    "judge in the one that trains, --judge-in-same-world (in Python judge_in_same_world=True), or "
    "not at all, --evaluation-episodes 0"
)


def lent(world: Any) -> Any:
    """What builds worlds, or a world of the user's that a run leaves open."""
    if isinstance(world, gymnasium.Env):
        return _Lent(world)
    return _LentVector(world) if isinstance(world, VectorEnv) else world


class _Lent(gymnasium.Wrapper):
    def close(self) -> None:
        """Whoever built it closes it."""


class _LentVector(VectorWrapper):
    def close(self, **_: Any) -> None:
        """Whoever built it closes it."""


def in_same_world(config: Config) -> bool:
    """Whether no world is opened for evaluations."""
    return config.judge_in_same_world or config.evaluation_episodes == 0


def how_judged(config: Config, is_compiled: bool) -> list[str]:
    """What a user is told of evaluations that are not as usual."""
    if config.evaluation_episodes == 0:
        return ["Nothing is evaluated: the last policy counts as the best."]
    if config.judge_in_same_world and not is_compiled:
        return [
            "Evaluations are played in the world that trains: each cuts the episode under way, and "
            "training goes on with a new one."
        ]
    return []


def open_apart(config: Config, opened: Callable[[int], Any]) -> tuple[Any, Any]:
    """The worlds to train in, and those to judge in.

    Args:
        config: Of the run.
        opened: A number of copies -> `integrations.gymnasium.worlds.Worlds`.

    Raises:
        ValueError: They do not fit, are one object, or gather statistics; says what to give.
    """
    worlds = opened(config.seeds * config.num_envs)
    _check_apart(worlds, config)
    judged = None
    try:
        _check_number(worlds, config)
        if said := gathering(worlds):
            raise ValueError(said)
        judged = _judged(worlds, config, opened)
    finally:
        if judged is None:
            worlds.close()
    # Not closed where it is refused: one that came twice is somebody else's.
    if judged is not worlds and not in_same_world(config):
        _check_judged(worlds, judged)
    return worlds, judged


def _judged(worlds: Any, config: Config, opened: Callable[[int], Any]) -> Any:
    """A world for each learner; a vector environment has its own number, as in training."""
    is_batch = isinstance(worlds, BatchedWorlds)
    if in_same_world(config):
        return worlds if is_batch else PlainWorlds(copies(worlds)[:: config.num_envs])
    try:
        return opened(worlds.num if is_batch else config.seeds)
    except (ValueError, WorldError) as error:
        raise ValueError(
            "No second world can be opened for evaluations beside the one that trains "
            f"({str(error).rstrip('.')}): {IN_THE_SAME}."
        ) from error


def _check_number(worlds: Any, config: Config) -> None:
    if worlds.num != config.seeds * config.num_envs:
        raise ValueError(
            f"{worlds.spec.name!r} has {worlds.num} copies, which is not seeds * num_envs = "
            f"{config.seeds} * {config.num_envs}: give numbers that fit."
        )


def _check_apart(worlds: Any, config: Config) -> None:
    """Refuses copies that are one object: a step of one would be a step of the others."""
    owners: dict[int, int] = {}
    for i, copy in enumerate(copies(worlds)):
        for layer in layers(copy):
            if owners.setdefault(id(layer), i) != i:
                raise ValueError(
                    f"Worlds {owners[id(layer)]} and {i} of {worlds.num} are one and the same "
                    f"{type(layer).__name__}: let what makes them build a new one at each call, or "
                    "train in one, with seeds and num_envs 1."
                )


def _check_judged(worlds: Any, judged: Any) -> None:
    """Refuses to judge where it is trained: training would go on from a state that is gone."""
    found = shared(copies(worlds), copies(judged))
    if found is not None:
        raise ValueError(
            f"Training and evaluations were given one and the same {type(found).__name__}: give a "
            f"function that builds a new one at each call, or {IN_THE_SAME}."
        )
