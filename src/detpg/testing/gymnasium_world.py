"""Is somebody's Gymnasium environment fit to be learnt in? Gymnasium's own checks and ours."""

import re
import warnings
from collections.abc import Callable
from typing import Any

import gymnasium
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import TimeLimit

from detpg.integrations.gymnasium.flat import FlatActions, FlatObservations
from detpg.integrations.gymnasium.hosted import close_all, name_of
from detpg.integrations.gymnasium.layers import gathering
from detpg.integrations.gymnasium.plain import PlainWorlds
from detpg.integrations.gymnasium.worlds import build, check_built
from detpg.testing.beside import Anew, judge_beside, judge_memory
from detpg.testing.findings import Finding, fine, problem, warning
from detpg.testing.judgements import (
    judge_action,
    judge_bounds,
    judge_ends,
    judge_finite,
    judge_observation_bounds,
    judge_observation_scale,
    judge_pixels,
    judge_reward,
    judge_rewriting,
    judge_seed,
    judge_space,
)
from detpg.testing.played import Play, play
from detpg.world_error import sentence

STEPS, REPEATED = 2000, 500
OWN = "Gymnasium's own checks"
# What Gymnasium warns of and does not matter here: actions are in units of their box, and what is
# to be said of missing bounds is said by us.
TASTE = ("symmetric and normalized space", "is probably too low", "is probably too high")
COLOUR = re.compile(r"\x1b\[\d*m")


def check_gymnasium(
    environment: str | gymnasium.Env | Callable[..., gymnasium.Env],
    *,
    steps: int = STEPS,
    seed: int = 0,
    time_limit: int | None = None,
    options: dict[str, Any] | None = None,
) -> list[Finding]:
    """Plays a Gymnasium environment at random and says what may stand in the way of learning.

    Args:
        environment: An id, a class or function that makes it, or an environment, which is reset.
        steps: Random actions that are tried; a quarter of them, at most 500, are repeated.
        seed: Of the world and of the actions.
        time_limit: As in `open_worlds`.
        options: Keyword arguments of what makes it.

    Returns:
        What was found: problems, warnings, and what is fine.

    Raises:
        ValueError: What cannot be built at all, in one sentence.
        WorldError: What makes it raised.
    """
    if steps < 1:
        raise ValueError(f"steps = {steps} is not usable: give 1 or more.")
    given = isinstance(environment, gymnasium.Env)
    if given:
        check_built(environment, options, None)
    make: Any = environment
    anew = None if given else lambda: build(make, options or {}, time_limit)
    env = environment if given else build(make, options or {}, time_limit)
    if not isinstance(env, gymnasium.Env):
        raise ValueError(f"{type(env).__name__} is not one environment: give one of its copies.")
    try:
        limited = TimeLimit(env, time_limit) if given and time_limit is not None else env
        return _spaces(env) or [*_gymnasiums(env), *_ours(limited, anew, steps, seed)]
    finally:
        if not given:
            close_all(name_of(env.unwrapped), [env])


def _spaces(env: gymnasium.Env) -> list[Finding]:
    """What cannot be used at all; nothing is played then."""
    findings = []
    for check, look in (
        ("observation space", lambda: FlatObservations(env.observation_space)),
        ("action space", lambda: FlatActions(env.action_space, 1)),
    ):
        try:
            look()
        except ValueError as error:
            found, advice = str(error).rsplit(": ", 1)
            findings.append(problem(check, f"{found}.", advice[0].upper() + advice[1:]))
    return findings


def _gymnasiums(env: gymnasium.Env) -> list[Finding]:
    """What `gymnasium.utils.env_checker.check_env` says of the world without its wrappers."""
    findings = []
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            check_env(env.unwrapped, skip_render_check=True)
        except Exception as error:
            advice = "Mend what Gymnasium asks of every environment."
            findings.append(problem(OWN, sentence(error), advice))
    words = dict.fromkeys(COLOUR.sub("", str(warned.message)) for warned in said)
    for text in words:
        if text.startswith("WARN: ") and not any(taste in text for taste in TASTE):
            found = text.removeprefix("WARN: ").strip()
            findings.append(warning(OWN, found, "See the words of Gymnasium."))
    return findings or [fine(OWN, "Gymnasium's check_env has no objection.")]


def _ours(env: gymnasium.Env, anew: Anew | None, steps: int, seed: int) -> list[Finding]:
    first = play(env, steps, seed, seed)
    if first.fault:
        advice = "Mend the world: random actions inside its action space must be safe."
        return [problem("steps", f"{first.fault[0].upper()}{first.fault[1:]}.", advice)]
    worlds = PlainWorlds([env])
    few = min(REPEATED, max(steps // 4, 1))
    again = play(env, few, seed, seed, first.actions)
    other = play(env, few, seed, (seed + 1) % 2**31)
    findings = [judge_bounds(worlds.spec), _seed(env, anew, worlds, first, again, seed)]
    if again.fault or other.fault:
        fault = again.fault or other.fault
        advice = "Let reset put back all that a step changes."
        return [*findings, problem("steps", f"In a second run, {fault}.", advice)]
    if findings[-1].level == "fine":  # else whatever differs may differ by chance
        findings.append(judge_action(first, other))
        findings += [] if anew is None else [judge_beside(env, anew, again, seed)]
    finite = judge_finite(first)
    findings += [finite, *judge_space(first), judge_rewriting(first)]
    findings += judge_pixels(env.observation_space)
    if finite.level == "fine":
        findings += [*judge_observation_scale(first), judge_reward(first)]
        findings += judge_observation_bounds(first, worlds.spec)
    return [*findings, judge_ends(first, worlds.time_limit)]


def _seed(
    env: gymnasium.Env, anew: Anew | None, worlds: PlainWorlds, first: Play, again: Play, seed: int
) -> Finding:
    """Whether a run can be repeated, and if not, why."""
    if said := gathering(worlds):
        found, advice = said.rsplit(": ", 1)
        return problem("running statistics", f"{found}.", f"{advice[0].upper()}{advice[1:]}")
    finding = judge_seed(first, again)
    if finding.level == "fine" or anew is None or again.fault:
        return finding
    return judge_memory(env, anew, again, finding, seed)
