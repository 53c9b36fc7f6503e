"""What is to be said of a play: one finding for each thing that learning depends on."""

import math

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Dict, Tuple

from detpg.bounds import NO_BOUND
from detpg.testing.findings import Finding, components, fine, problem, warning
from detpg.testing.played import Play
from detpg.types import EnvironmentSpec

# Root mean square of what learns without a normaliser; rewards may be rare, and then small.
OBSERVATION_SIZES, REWARD_SIZES = (0.1, 10.0), (0.01, 10.0)
FEWEST_PIXELS = 100  # of what is taken for a picture
WIDEST = 1e6  # half a range beyond which bounds are no scale
COARSE = 1e-3  # of the spread: steps of single precision below it take nothing away
FILLED = 1e-3  # of its bounds: an observation that fills less stays in one tile


def judge_bounds(spec: EnvironmentSpec) -> Finding:
    """Whether the bounds say what a large action is."""
    check, (low, high) = "action bounds", spec.bounds
    open_ends = [k for k, ends in enumerate(zip(low, high)) if not np.all(np.isfinite(ends))]
    if open_ends:
        return warning(
            check,
            f"Component {open_ends[0]} of the action has no bound on one side or both.",
            f"Give it finite bounds (those of {NO_BOUND:g} or more count as none): without them 1 "
            "in a policy's output and in its exploration is 1 in the world's own unit, and nothing "
            "caps it.",
        )
    wide = [k for k, half in enumerate(spec.bounds.half_range) if half > WIDEST]
    if wide:
        return warning(
            check,
            f"Component {wide[0]} of the action ranges from {low[wide[0]]:g} to {high[wide[0]]:g}.",
            "Narrow the bounds to what can be useful: exploration is in units of half the range.",
        )
    return fine(check, "Every component of the action is bounded; policies act in units of that.")


def judge_seed(first: Play, again: Play) -> Finding:
    """Whether a run can be repeated."""
    check, differs = "same seed", first.differs(again)
    if differs is None:
        found = f"The same seed and actions gave the same {len(again.rewards)} steps, to the bit."
        return fine(check, found)
    where = "at the reset" if differs == 0 else f"at step {differs}"
    return problem(
        check,
        f"The same seed and the same actions gave something else {where}.",
        "Draw all that is random from self.np_random after super().reset(seed=seed), and let reset "
        "put back all that a step changes.",
    )


def judge_action(first: Play, other: Play) -> Finding:
    """Whether it matters what one does."""
    check = "action"
    if first.differs(other) is None:
        return problem(
            check,
            f"Other actions gave the same {len(other.rewards)} steps, to the bit.",
            "Let step use its action: here no policy is better than another.",
        )
    return fine(check, "Other actions lead elsewhere.")


def judge_finite(play: Play) -> Finding:
    """Whether all numbers are numbers."""
    check = "finite numbers"
    bad = [t for t, reward in enumerate(play.rewards, 1) if not np.isfinite(reward)]
    if bad:
        return problem(
            check,
            f"The reward of step {bad[0]} was {play.rewards[bad[0] - 1]}.",
            "Return a finite reward, and terminate where the world breaks down.",
        )
    for observation in play.observations:
        lost = np.flatnonzero(~np.isfinite(observation))
        if lost.size:
            return problem(
                check,
                f"Component {lost[0]} of an observation was {observation[lost[0]]}.",
                "Return finite observations, and terminate where the world breaks down.",
            )
    return fine(check, "All rewards and observations were finite.")


def judge_space(play: Play) -> list[Finding]:
    """Whether observations are what their space says."""
    check, findings = "observation space", []
    if play.beyond:
        advice = "Widen observation_space, or clip the observation: bounds are taken at their word."
        findings.append(problem(check, f"In an observation, {play.beyond}.", advice))
    if play.unlike:
        advice = "Return it as the space says, such as np.asarray(observation, space.dtype)."
        findings.append(warning(check, f"In an observation, {play.unlike}.", advice))
    return findings or [fine(check, "Every observation lay inside its space.")]


def judge_pixels(space: gymnasium.Space) -> list[Finding]:
    """Whether observations, or a part of them, are a camera's."""
    if isinstance(space, Dict | Tuple):
        parts = space.values() if isinstance(space, Dict) else space.spaces
        return [finding for part in parts for finding in judge_pixels(part)][:1]
    shape, size = space.shape or (), math.prod(space.shape or ())
    flat = len(shape) < (2 if space.dtype == np.uint8 else 3)
    if not isinstance(space, Box) or flat or size < FEWEST_PIXELS:
        return []
    return [
        warning(
            "pixels",
            f"The observation holds a picture: {space.dtype} of shape {shape}, {size} numbers.",
            "Pixels are not what these learners take: observe what the picture shows (positions, "
            "speeds), put a trained feature extractor before it (gymnasium.wrappers."
            "TransformObservation), or at least make it small (GrayscaleObservation, "
            "ResizeObservation); it is flattened in any case.",
        )
    ]


def judge_rewriting(play: Play) -> Finding:
    """Whether what was handed on stays as it was."""
    check = "observations stay"
    if play.rewritten is None:
        return fine(check, "No step changed an observation that was handed on before it.")
    return problem(
        check,
        f"Step {play.rewritten} changed the observation that was handed on before it.",
        "Return a copy, observation.copy(): whoever keeps an observation, as a replay memory does, "
        "keeps another one.",
    )


def judge_observation_scale(play: Play) -> list[Finding]:
    """Whether the components of the observation are of a size of about 1."""
    check = "observation scale"
    seen = np.stack(play.observations)
    sizes = np.sqrt(np.mean(seen**2, axis=0))
    still = np.flatnonzero(np.all(seen == seen[0], axis=0))
    least, most = OBSERVATION_SIZES
    lost = _lost_in_single(seen)
    told = {*still, *lost}
    off = [k for k, size in enumerate(sizes) if k not in told and not least <= size <= most]
    findings = []
    if lost.size:
        k, spacing = lost[0], np.spacing(np.float32(np.abs(seen[:, lost[0]]).max()))
        findings.append(
            problem(
                check,
                f"Component {k} of the observation lies near {seen[-1, k]:.7g}, where single "
                f"precision knows steps of {spacing:.2g} alone: most of its changes are lost.",
                "Subtract the offset in the world, as the time of the reset from a clock: learners "
                "compute in single precision, and no normaliser brings back what it lost.",
            )
        )
    if still.size:
        names = components(map(str, still), still.size)
        found = f"It never changed in {len(play.rewards)} steps: {names}."
        findings.append(warning(check, found, "Leave out what says nothing, or make it say it."))
    if off:
        names = components((f"{k} ({sizes[k]:.2g})" for k in off), len(off))
        findings.append(
            warning(
                check,
                f"Far from a size of 1 (root mean square): {names}.",
                "Normalise observations (--normalise observations, the default of detpg train), or "
                "scale them in the world.",
            )
        )
    return findings or [fine(check, f"Components of size {min(sizes):.2g} to {max(sizes):.2g}.")]


def _lost_in_single(seen: np.ndarray) -> np.ndarray:
    """Components most of whose changes, of weight beside their spread, vanish in float32.

    They may have vanished before: then the component stands still, and moves by a last bit at once.
    """
    rounded = seen.astype(np.float32)
    steps = np.diff(seen, axis=0)
    changes = np.count_nonzero(steps, axis=0)
    vanished = np.sum((steps != 0) & (np.diff(rounded, axis=0) == 0), axis=0)
    spacing = np.spacing(np.abs(rounded).max(axis=0)).astype(float)
    coarse = spacing > COARSE * np.std(seen, axis=0)
    jumps = (changes > 0) & (2 * changes < len(steps)) & np.all(steps % spacing == 0, axis=0)
    return np.flatnonzero(coarse & (2 * vanished > changes) | coarse & jumps)


def judge_observation_bounds(play: Play, spec: EnvironmentSpec) -> list[Finding]:
    """Whether bounds are so wide that tiles over them would see no difference."""
    seen, bounds = np.stack(play.observations), (spec.observation_low, spec.observation_high)
    filled = np.ptp(seen, axis=0)
    for k, (low, high) in enumerate(zip(*bounds)):
        if np.isfinite(high - low) and 0 < filled[k] < FILLED * (high - low):
            return [
                warning(
                    "observation bounds",
                    f"Component {k} of the observation moved by {filled[k]:.2g} in all, but its "
                    f"bounds are {low:g} and {high:g}.",
                    "Narrow the bounds to what can be seen, or normalise observations: tiles over "
                    "these bounds see no difference.",
                )
            ]
    return []


def judge_reward(play: Play) -> Finding:
    """Whether the reward says anything, and whether its size is about 1."""
    rewards = np.asarray(play.rewards)
    size = float(np.sqrt(np.mean(rewards**2)))
    lengths = {end.length for end in play.ended if end.terminated}
    if len(rewards) > 1 and np.all(rewards == rewards[0]) and len(lengths) < 2:
        return warning(
            "reward",
            f"The reward was {rewards[0]:g} in all {len(rewards)} steps of random actions.",
            "Check that some actions earn more: until the reward changes, or an episode ends "
            "earlier, there is nothing to learn from.",
        )
    least, most = REWARD_SIZES
    if not least <= size <= most:
        return warning(
            "reward scale",
            f"The rewards are of size {size:.2g} (root mean square).",
            "Normalise rewards (--normalise both), or scale them in the world: step sizes are "
            "meant for rewards of about 1.",
        )
    return fine("reward scale", f"The rewards are of size {size:.2g} (root mean square).")


def judge_ends(play: Play, limit: int | None) -> Finding:
    """Whether episodes end, and whether a time limit is told from a true end."""
    check, steps, lengths = "episodes", len(play.rewards), sorted({e.length for e in play.ended})
    if not play.ended and limit is None:
        return warning(
            check,
            f"No episode ended in {steps} steps, and no time limit is known.",
            "Give a time limit (--time-limit, or max_episode_steps where it is registered): "
            "without one training refuses to evaluate in it.",
        )
    if not play.ended:
        return fine(check, f"No episode ended in {steps} steps; the time limit is {limit}.")
    span = f"{lengths[0]}" if len(lengths) == 1 else f"{lengths[0]} to {lengths[-1]}"
    ends = f"Episodes that ended: {len(play.ended)}, of length {span}"
    clocked = len(lengths) == 1 < lengths[0] and all(e.terminated for e in play.ended)
    if clocked and len(play.ended) > 1:
        say = problem if lengths[0] == limit else warning
        which = "the time limit" if lengths[0] == limit else "whatever was done"
        return say(
            check,
            f"{ends}, {which}, and all with terminated=True.",
            "If that is a time limit, return terminated=False and truncated=True: terminated says "
            "that nothing can be earned from there on, and values come out wrong.",
        )
    if limit is None and not any(end.truncated for end in play.ended):
        return warning(
            check,
            f"{ends}; no time limit is known.",
            "Give a time limit (--time-limit, or max_episode_steps where it is registered): the "
            "evaluation of a policy that never ends an episode is else cut after 10,000 steps.",
        )
    return fine(check, f"{ends}; the time limit is {'not known' if limit is None else limit}.")
