"""What an environment is made of: its wrappers and copies, and the statistics that they gather."""

import itertools
from collections.abc import Iterator, Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AsyncVectorEnv, VectorEnv

from detpg.integrations.gymnasium.hosted import Worlds

WORLDS = gymnasium.Env | VectorEnv
# A mean and a spread whose names begin alike are a running statistic, if they move.
MEANS = ("mean", "mu", "avg", "average")
SPREADS = ("var", "variance", "std", "sigma", "m2", "s", "scale", "deviation")
KNOWN = ("obs_rms", "return_rms", "ret_rms", "rew_rms", "reward_rms")  # in other processes
KINDS = {"observations": ("obs", "state"), "rewards": ("ret", "rew")}  # words in their names
PROBED, MOST = 3, 1000  # steps; parts of a collection that are looked at


def layers(env: Any) -> list[Any]:
    """The environment and every one that it holds, outermost first."""
    found: dict[int, Any] = {}
    waiting = [env]
    while waiting:
        layer = waiting.pop(0)
        if id(layer) not in found:
            found[id(layer)] = layer
            held = (part for value in _members(layer).values() for part in _parts(value))
            waiting += [part for part in held if isinstance(part, WORLDS)]
    return list(found.values())


def copies(worlds: Any) -> list[Any]:
    """The environments of several worlds; of a vector environment its copies, if they are here."""
    if hasattr(worlds, "envs"):
        return list(worlds.envs)
    return list(getattr(worlds.env.unwrapped, "envs", ())) or [worlds.env]


def shared(ones: list[Any], others: list[Any]) -> Any | None:
    """An environment that some of the first and some of the second hold; None if there is none."""
    known = {id(layer) for one in ones for layer in layers(one)}
    return next((x for other in others for x in layers(other) if id(x) in known), None)


def gathering(worlds: Worlds) -> str:
    """Says that a layer gathers statistics over episodes; empty where none does.

    Training, evaluations and an exported controller would each have others. Worlds that look so are
    reset and stepped a little: statistics that stay as they are do no harm.

    Args:
        worlds: One or several, as an engine drives them.
    """
    env = copies(worlds)[0] if hasattr(worlds, "envs") else getattr(worlds, "env")  # noqa: B009
    if not _statistics(env):
        return ""
    seeds = range(worlds.num)
    low, high = map(np.asarray, worlds.spec.bounds)
    action = np.tile(np.clip(0.0, low, high), (worlds.num, 1))
    worlds.reset(seeds)
    before = _statistics(env)
    for _ in range(PROBED):
        worlds.step(action)
    worlds.reset(seeds)
    moved = [key for key, numbers in _statistics(env).items() if before.get(key) != numbers]
    if not moved:
        return ""
    layer, name = moved[0]
    kind = next((k for k, words in KINDS.items() if any(word in name for word in words)), "both")
    return (
        f"The world's {layer} keeps running statistics ({name}), so that training, evaluations and "
        f"an exported controller see different numbers: take it off and let the learner normalise, "
        f"--normalise {kind} (in Python normalise={kind!r})."
    )


def _statistics(env: Any) -> dict[tuple[str, str], bytes]:
    """Class of the layer and name of the statistic -> its mean and spread."""
    found: dict[tuple[str, str], bytes] = {}
    for layer in layers(env):
        kind, members = type(layer).__name__, {**vars(type(layer)), **_members(layer)}
        found |= {(kind, name or "mean"): numbers for name, numbers in _running(members)}
        for name, value in members.items():
            held = (part for part in _parts(value) if not isinstance(part, WORLDS))
            parts = [numbers for part in held for _, numbers in _running(_members(part))]
            found |= {(kind, name): b"".join(parts)} if parts else {}
    inside = env.unwrapped
    if isinstance(inside, AsyncVectorEnv):
        for name in (name for name in KNOWN if any(inside.call("has_wrapper_attr", name))):
            kept = [numbers for x in inside.call(name) for _, numbers in _running(_members(x))]
            found["wrapper", name] = b"".join(kept)
    return found


def _running(members: Mapping[str, Any]) -> Iterator[tuple[str, bytes]]:
    """Statistics among named values: what their names begin with, their mean and spread."""
    groups: dict[str, dict[str, np.ndarray]] = {}
    for name, value in members.items():
        start, _, last = name.strip("_").rpartition("_")
        if last.lower() in (*MEANS, *SPREADS) and _is_number(value):
            groups.setdefault(start, {})[last.lower()] = np.asarray(value)
    for start, group in groups.items():
        mean, spread = (
            next((group[name] for name in names if name in group), None)
            for names in (MEANS, SPREADS)
        )
        if mean is not None and spread is not None:
            yield start, mean.tobytes() + spread.tobytes()


def _is_number(value: Any) -> bool:
    if not isinstance(value, int | float | np.generic | list) and not hasattr(value, "__array__"):
        return False
    return np.asarray(value).dtype.kind in "fiu"


def _members(value: Any) -> Mapping[str, Any]:
    """What a record holds, by name."""
    if isinstance(value, Mapping):
        return {name: held for name, held in value.items() if isinstance(name, str)}
    return getattr(value, "__dict__", {})


def _parts(value: Any) -> Iterator[Any]:
    """A value, and what is in it where it is a collection."""
    yield value
    if isinstance(value, list | tuple):
        yield from value[:MOST]
    elif isinstance(value, Mapping):
        yield from itertools.islice(value.values(), MOST)
