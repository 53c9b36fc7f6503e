"""Any Gymnasium environment as worlds that a compiled learner is driven by.

worlds = open_worlds("Pendulum-v1", 8)
observation = worlds.reset(range(8))
step = worlds.step(actions)  # (8, 1), inside the box, in the world's own units
"""

from collections.abc import Callable
from typing import Any

import gymnasium
from gymnasium.vector import VectorEnv
from gymnasium.wrappers import TimeLimit

from detpg.integrations.gymnasium.batched import BatchedWorlds
from detpg.integrations.gymnasium.hosted import NO_TIME_LIMIT, Step, Worlds, sentence
from detpg.integrations.gymnasium.plain import PlainWorlds

__all__ = ["NO_TIME_LIMIT", "Step", "Worlds", "build", "open_worlds"]

Options = dict[str, Any]


def open_worlds(
    environment: str | gymnasium.Env | Callable[..., Any] | VectorEnv,
    num: int = 1,
    *,
    options: Options | None = None,
    time_limit: int | None = None,
    render_mode: str | None = None,
) -> Worlds:
    """Builds `num` worlds, or takes those that are given.

    Args:
        environment: An id as `gymnasium.make` takes it ("Pendulum-v1", "module:Mine-v0",
            "detpg/OctopusArm-v0"); a class or function that makes an environment; an environment;
            or a vector environment, which has its own number of copies.
        num: How many worlds.
        options: Keyword arguments of what makes them.
        time_limit: Steps after which an episode is truncated, instead of the registered limit; a
            limit of the world's own that is shorter stays.
        render_mode: Of world 0, such as "rgb_array".

    Raises:
        ValueError: What cannot be built or used, in one sentence.
    """
    for name, value in (("num", num), ("time_limit", time_limit)):
        if value is not None and value < 1:
            raise ValueError(f"{name} = {value} is not usable: give 1 or more.")
    if isinstance(environment, gymnasium.Env | VectorEnv):
        check_built(environment, options, render_mode)
        return _taken(environment, num, time_limit)
    made: list[Any] = []
    try:
        for i in range(num):
            mode = {"render_mode": render_mode} if render_mode is not None and i == 0 else {}
            made.append(build(environment, {**(options or {}), **mode}, time_limit))
            if isinstance(made[0], VectorEnv):
                return _taken(made[0], num, time_limit)
        return PlainWorlds(made)
    except ValueError as error:
        for env in made:
            env.close()
        if 0 < len(made) < num:
            raise ValueError(
                f"{num} worlds cannot be open at once ({str(error).rstrip('.')}): take fewer, with "
                "seeds and num_envs 1 a single one."
            ) from error
        raise


def build(make: str | Callable[..., Any], options: Options, time_limit: int | None) -> Any:
    """One environment, or a vector environment, from what makes it.

    Raises:
        ValueError: Whatever stops it from being built, in one sentence.
    """
    name = make if isinstance(make, str) else getattr(make, "__name__", type(make).__name__)
    try:
        if isinstance(make, str):
            limit = {} if time_limit is None else {"max_episode_steps": time_limit}
            # What Gymnasium's checker looks at is looked at once, by detpg.testing.
            return gymnasium.make(make, disable_env_checker=True, **{**options, **limit})
        env = make(**options)
    except Exception as error:  # a world of somebody else's may fail in any way
        raise ValueError(f"environment {name!r} cannot be built: {sentence(error)}") from error
    if not isinstance(env, gymnasium.Env | VectorEnv):
        kind = f"{type(env).__module__}.{type(env).__name__}"
        raise ValueError(f"{name} made a {kind}: let it make a gymnasium.Env.")
    return _limited(env, time_limit) if isinstance(env, gymnasium.Env) else env


def _limited(env: gymnasium.Env, time_limit: int | None) -> gymnasium.Env:
    return env if time_limit is None else TimeLimit(env, time_limit)


def _taken(env: gymnasium.Env | VectorEnv, num: int, time_limit: int | None) -> Worlds:
    """What is built already, once."""
    if isinstance(env, gymnasium.Env):
        if num != 1:
            raise ValueError(
                f"One environment cannot be {num} worlds: give its id, its class or a function "
                "that makes it."
            )
        return PlainWorlds([_limited(env, time_limit)])
    if num not in (1, env.num_envs):
        raise ValueError(
            f"The vector environment has {env.num_envs} copies, not {num}: leave num out."
        )
    worlds = BatchedWorlds(env)
    if time_limit not in (None, worlds.time_limit):
        raise ValueError(
            f"A time limit of {time_limit} cannot be given to a vector environment: make it with "
            "max_episode_steps, or with copies in gymnasium.wrappers.TimeLimit."
        )
    return worlds


def check_built(
    env: gymnasium.Env | VectorEnv, options: Options | None, render_mode: str | None
) -> None:
    """Refuses what can only be said before an environment is built.

    Raises:
        ValueError: Says what to give instead.
    """
    if options:
        raise ValueError(
            f"The environment is built already and takes no {', '.join(options)}: give its id, or "
            "build it with them."
        )
    if render_mode not in (None, env.render_mode):
        raise ValueError(
            f"The environment is built already, with render_mode {env.render_mode!r} and not "
            f"{render_mode!r}: build it with that."
        )
