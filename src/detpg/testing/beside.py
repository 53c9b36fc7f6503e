"""What a world keeps over its resets, and what a second world beside it does to it."""

from collections.abc import Callable
from typing import Any

import gymnasium

from detpg.integrations.gymnasium.layers import layers, shared
from detpg.testing.findings import Finding, fine, problem, warning
from detpg.testing.played import Play, play
from detpg.world_error import WorldError

SECOND = "second world"
ONE = (
    "Build a new one at each call, or train with one seed and judge in the same one: `detpg train "
    "... --judge-in-same-world`, or --evaluation-episodes 0."
)
Anew = Callable[[], Any]


def judge_memory(
    env: gymnasium.Env, anew: Anew, first: Play, finding: Finding, seed: int
) -> Finding:
    """Why the same seed gave something else: by chance, or by what was done before.

    Args:
        env: What was played.
        anew: Builds another one.
        first: Its actions are repeated.
        finding: What is said of chance.
        seed: Of the world.
    """
    if not _repeats(env, anew, first, seed):
        return finding
    fresh = anew()
    inwards = [layer for layer in layers(fresh) if isinstance(layer, gymnasium.Env)]
    keeper = next((x for x in reversed(inwards) if not _forgets(x, first, seed)), env.unwrapped)
    fresh.close()
    return problem(
        finding.check,
        f"{finding.found[:-1]}, but not in worlds built anew: {type(keeper).__name__} keeps "
        "something over its resets.",
        "Let reset put back all that a step changes: worlds that train and that judge, and an "
        "exported controller, do not share what is kept.",
    )


def _repeats(env: gymnasium.Env, anew: Anew, first: Play, seed: int) -> bool:
    """Whether two worlds built one after the other, if they can be, do the same."""
    plays = []
    for _ in range(2):
        try:
            fresh = anew()
        except ValueError:
            return False
        if shared([env], [fresh]) is not None:
            return False
        plays.append(play(fresh, len(first.actions), seed, seed, first.actions))
        fresh.close()
    return _same(*plays)


def _forgets(layer: gymnasium.Env, first: Play, seed: int) -> bool:
    """Whether a layer by itself does the same again."""
    one = play(layer, len(first.actions), seed, seed)
    return _same(one, play(layer, len(one.actions), seed, seed, one.actions))


def _same(one: Play, other: Play) -> bool:
    return one.fault == other.fault and (bool(one.fault) or one.differs(other) is None)


def judge_beside(env: gymnasium.Env, anew: Anew, alone: Play, seed: int) -> Finding:
    """Whether a second world can be opened, and leaves the first one alone.

    Args:
        env: The first one.
        anew: Builds the second one.
        alone: What the first one does without it.
        seed: Of that.
    """
    try:
        other = anew()
    except (ValueError, WorldError) as error:
        return warning(SECOND, f"None can be opened beside the first: {error}", ONE)
    same = shared([env], [other])
    if same is not None:
        return warning(SECOND, f"What builds it gave the same {type(same).__name__} twice.", ONE)
    found = play(_Disturbed(env, other), len(alone.actions), seed, seed, alone.actions)
    other.close()
    if _same(alone, found):
        return fine(SECOND, "One beside it, opened and stepped, changed nothing.")
    step = None if found.fault else alone.differs(found)
    words = (
        f"{found.fault[:1].upper()}{found.fault[1:]}"
        if found.fault
        else (
            f"The first one did something else {'at the reset' if step == 0 else f'at step {step}'}"
        )
    )
    return problem(SECOND, f"{words}, when another was stepped beside it.", ONE)


class _Disturbed(gymnasium.Wrapper):
    """The first world, while another one lives beside it."""

    def __init__(self, env: gymnasium.Env, other: gymnasium.Env):
        super().__init__(env)
        self._other = other

    def reset(self, **given: Any) -> Any:
        result = super().reset(**given)
        self._other.reset(seed=(given.get("seed") or 0) + 1)
        return result

    def step(self, action: Any) -> Any:
        result = super().step(action)
        _, _, terminated, truncated, _ = self._other.step(action.copy())
        if terminated or truncated:
            self._other.reset()
        return result
