"""What drives a learner from outside: worlds that step on the host, in NumPy arrays."""

import warnings
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol, runtime_checkable

import gymnasium
import numpy as np
from gymnasium.error import Error
from gymnasium.vector import VectorEnv
from gymnasium.wrappers import TimeLimit

from detpg.integrations.gymnasium.flat import FlatActions, FlatObservations
from detpg.integrations.gymnasium.returned import blame
from detpg.types import Environment, EnvironmentSpec
from detpg.world_error import sentence

NO_TIME_LIMIT = 2**31 - 1  # in a spec, where none is known
DISCOUNT = 0.99  # of a world that does not say


class Step(NamedTuple):
    """What a step of all worlds brings: float32 and bool, a leading axis `num`.

    The arrays are the caller's; `observation` is `next_observation` itself if no world was reset.

    Attributes:
        reward: Of the step.
        next_observation: Where it led, before any reset.
        terminated: A true end: nothing to bootstrap from.
        truncated: A time limit; both may be true.
        observation: Where the next action is chosen: after the reset, if there was one.
        valid: False where this call only reset a world: nothing to learn from it.
    """

    reward: np.ndarray
    next_observation: np.ndarray
    terminated: np.ndarray
    truncated: np.ndarray
    observation: np.ndarray
    valid: np.ndarray


@runtime_checkable
class Worlds(Protocol):
    """`num` worlds of one kind; actions and observations are vectors.

    Attributes:
        spec: Bounds in the world's own units; `time_limit` is NO_TIME_LIMIT where none is known.
        num: How many.
        time_limit: Steps, or None where none is known: evaluation then needs one.
        frame_rate: Pictures a second of what `render` draws.
    """

    spec: EnvironmentSpec
    num: int
    time_limit: int | None
    frame_rate: float

    def reset(self, seeds: Sequence[int]) -> np.ndarray:
        """New episodes in all worlds, observations (num, d); later ones follow from the seeds."""
        ...

    def step(self, actions: Any) -> Step:
        """One step of each world; actions (num, m) inside the box, in the world's own units."""
        ...

    def render(self) -> Any:
        """What world 0 draws of itself, if it was opened with a render mode."""
        ...

    def close(self) -> None:
        """Ends them; they cannot be used any more."""
        ...


def spec_of(
    name: str,
    observations: FlatObservations,
    actions: FlatActions,
    time_limit: int | None,
    own: EnvironmentSpec | None,
) -> EnvironmentSpec:
    """What a learner is built from; of this library's own worlds the discount is known."""
    return EnvironmentSpec(
        name=name,
        observation_size=observations.size,
        action_size=actions.size,
        action_low=actions.low,
        action_high=actions.high,
        time_limit=NO_TIME_LIMIT if time_limit is None else time_limit,
        discount=DISCOUNT if own is None else own.discount,
        observation_low=observations.low,
        observation_high=observations.high,
    )


def own_spec(world: Any) -> EnvironmentSpec | None:
    """That of the environment inside, where the world is one of this library's."""
    inside = getattr(world, "environment", None)
    return inside.spec if isinstance(inside, Environment) else None


def name_of(world: Any) -> str:
    """The id under which a world without wrappers was made, or its class."""
    return type(world).__name__ if world.spec is None else world.spec.id


def limit_of(world: gymnasium.Env) -> int | None:
    """The least time limit that the wrappers or the world itself tell of."""
    limits: list[int | None] = []
    while isinstance(world, gymnasium.Wrapper):
        if isinstance(world, TimeLimit):
            limits.append(world._max_episode_steps)
        world = world.env
    own = own_spec(world)
    limits.append(None if own is None else own.time_limit)
    limits.append(None if world.spec is None else world.spec.max_episode_steps)
    return min((limit for limit in limits if limit is not None), default=None)


def whole_seeds(seeds: Sequence[int], num: int) -> list[int]:
    """One for each world, as Python's integers: Gymnasium takes no others."""
    if len(seeds) != num:
        raise ValueError(f"{len(seeds)} seeds do not fit {num} worlds: give one for each.")
    return [int(seed) for seed in seeds]


def picture(name: str, env: gymnasium.Env | VectorEnv) -> Any:
    """What a world, or the first of several, draws of itself: mostly pixels (see `filming`)."""
    if env.render_mode is None:
        return None
    try:
        drawn = env.render()
    except Error as error:
        raise ValueError(f"{name} cannot be drawn: {sentence(error)}") from error
    except Exception as error:  # a world of somebody else's may fail in any way
        blame(name, "render", error)
    if isinstance(env, VectorEnv) and drawn is not None:
        drawn = drawn[0]
    return drawn


def close_all(name: str, envs: Sequence[Any]) -> None:
    """Closes them all; what one of them raises loses nothing, and is said alone."""
    for env in envs:
        try:
            env.close()
        except Exception as error:  # a world of somebody else's may fail in any way
            words = f"The world {name!r} raised {type(error).__name__} in close: {sentence(error)}"
            warnings.warn(f"{words} Nothing is lost.", RuntimeWarning, stacklevel=3)
