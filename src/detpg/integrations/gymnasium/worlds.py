"""Any Gymnasium environment as worlds that a compiled learner is driven by.

worlds = open_worlds("Pendulum-v1", 8)
observation = worlds.reset(range(8))
step = worlds.step(actions)  # (8, 1), inside the box, in the world's own units
"""

from collections.abc import Callable
from typing import Any

import gymnasium
from gymnasium.error import Error
from gymnasium.vector import VectorEnv
from gymnasium.wrappers import TimeLimit

from detpg.integrations.gymnasium.batched import BatchedWorlds
from detpg.integrations.gymnasium.hosted import NO_TIME_LIMIT, Step, Worlds, close_all
from detpg.integrations.gymnasium.plain import PlainWorlds
from detpg.world_error import WorldError, sentence

__all__ = ["NO_TIME_LIMIT", "Step", "Worlds", "build", "open_worlds"]

Options = dict[str, Any]
NONE = "no gymnasium.Env: derive its class from that"
OLD = "one of the old gym can be wrapped in shimmy.GymV21CompatibilityV0(env=...)"
# What Gymnasium says where an id makes something else.
NO_ENVIRONMENT = ("must inherit from the gymnasium.Env class", "Gym is incompatible with Gymnasium")


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
        WorldError: What makes them raised.
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
    except Exception as error:
        close_all(_name(environment), made)
        if isinstance(error, ValueError | WorldError) and 0 < len(made) < num:
            raise ValueError(
                f"{num} worlds cannot be open at once ({str(error).rstrip('.')}): take fewer, with "
                "seeds and num_envs 1 a single one."
            ) from error
        raise


def build(make: str | Callable[..., Any], options: Options, time_limit: int | None) -> Any:
    """One environment, or a vector environment, from what makes it.

    Raises:
        ValueError: There is none of that name, or what is made is none.
        WorldError: It raised something else.
    """
    name = _name(make)
    if not isinstance(make, str) and not callable(make):
        raise ValueError(f"{name} is {_no_environment(make)}.")
    try:
        if isinstance(make, str):
            limit = {} if time_limit is None else {"max_episode_steps": time_limit}
            # What Gymnasium's checker looks at is looked at once, by detpg.testing.
            env = gymnasium.make(make, disable_env_checker=True, **{**options, **limit})
        else:
            env = make(**options)
        if isinstance(env, gymnasium.Env):
            _ = env.observation_space, env.action_space  # a world may forget them, or look them up
    except (Error, ImportError) as error:
        raise ValueError(f"environment {name!r} cannot be built: {sentence(error)}") from error
    except Exception as raised:  # a world of somebody else's may fail in any way
        error = _own(raised)
        if any(words in str(error) for words in NO_ENVIRONMENT):
            raise ValueError(f"environment {name!r} is {NONE}; {OLD}.") from error
        words = f"{type(error).__name__}: {sentence(error)}"
        raise WorldError(f"environment {name!r} cannot be built", words) from error
    if not isinstance(env, gymnasium.Env | VectorEnv):
        kind = f"{type(env).__module__}.{type(env).__name__}"
        raise ValueError(f"{name} made a {kind}, which is {_no_environment(env)}.")
    # An id is made with its limit, and a vector environment says itself when it ends.
    return env if isinstance(make, str) or isinstance(env, VectorEnv) else _limited(env, time_limit)


def _own(error: Exception) -> Exception:
    """What the world itself raised, where Gymnasium has added its words."""
    inside = error.__cause__
    added = "was raised from the environment creator" in str(error)
    return inside if added and isinstance(inside, Exception) else error


def _name(make: Any) -> str:
    return make if isinstance(make, str) else getattr(make, "__name__", type(make).__name__)


def _no_environment(env: Any) -> str:
    """How to make an environment of what was given for one."""
    steps = hasattr(env, "step") and hasattr(env, "reset")
    return f"{NONE}; {OLD}" if steps else "no gymnasium.Env: give one, its id or what makes one"


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
