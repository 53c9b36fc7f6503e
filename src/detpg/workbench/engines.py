"""Which engine drives a run: compiled, the host's, or logged data."""

import dataclasses
from typing import Any

from detpg.environments import ENVIRONMENTS
from detpg.integrations.registration import IDS
from detpg.types import Environment
from detpg.workbench.compiled import Compiled, built, named
from detpg.workbench.config import Config
from detpg.workbench.hosted import Hosted
from detpg.workbench.opening import lent
from detpg.workbench.own import check_imported
from detpg.workbench.session import Engine


def engine_of(config: Config, world: Any = None) -> Engine:
    """The engine of a configuration.

    Args:
        config: Of the run.
        world: An environment of one's own instead of the one that is named: a record of
            `detpg.types.Environment` or its class, or a class or function that builds a
            `gymnasium.Env`; what builds it is given the environment's options. Or a `gymnasium.Env`
            itself, which is then judged in too.

    Raises:
        ValueError: A world that cannot be built or does not fit.
    """
    if config.data is not None:
        from detpg.workbench.replayed import Replayed

        return Replayed(config, None if config.environment is None else judging(config, world))
    return _world(config, world)


def judging(config: Config, world: Any = None) -> Compiled | Hosted:
    """The engine of a world in which nothing is learnt: one is enough to judge in."""
    return _world(dataclasses.replace(config, data=None, judge_in_same_world=True), world)


def _world(config: Config, world: Any) -> Compiled | Hosted:
    own = own_world(config) if world is None else _record(world, config)
    if own is not None:
        return Compiled(config, own)
    return Hosted(config, lambda num: hosted_worlds(config, world, num))


def own_world(config: Config) -> Environment | None:
    """The environment of the registry that a configuration names; None: it names another one."""
    name = IDS.get(str(config.environment), config.environment)
    return named(config, name) if name in ENVIRONMENTS else None


def _record(world: Any, config: Config) -> Environment | None:
    """The user's own record, built if it is a class; None where the world is Gymnasium's."""
    if not isinstance(world, Environment):
        return None
    options = config.environment_options
    if isinstance(world, type):
        return built(world, world.__name__, options)
    if options:
        raise ValueError(
            f"{type(world).__name__} is built already and takes no {', '.join(options)}: give its "
            "class, or build it with them."
        )
    return world


def hosted_worlds(config: Config, world: Any, num: int, render_mode: str | None = None) -> Any:
    """Copies of a Gymnasium environment, as `integrations.gymnasium.worlds.Worlds`."""
    from detpg.integrations.gymnasium.worlds import open_worlds

    if world is None:
        check_imported(config.environment)
    given = str(config.environment) if world is None else lent(world)
    options, limit = dict(config.environment_options), config.time_limit
    return open_worlds(given, num, options=options, time_limit=limit, render_mode=render_mode)
