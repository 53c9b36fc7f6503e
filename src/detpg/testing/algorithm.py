"""Conformance of an algorithm to `detpg.types.Algorithm`."""

import copy
import dataclasses
import io
import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PRNGKeyArray, PyTree

from detpg.learning import lesson
from detpg.testing.checks import (
    PURE,
    check_array,
    check_close,
    check_kept,
    check_protocol,
    check_pure,
    check_same,
    counted,
    failure,
    plain,
    require,
    snapshot,
    stack,
)
from detpg.training import TrainState, begin, train
from detpg.types import Algorithm, Environment, Hyper, Transition, hyper_parameters

NUM_UPDATES = 2


def check_algorithm(algorithm: Any, environment: Any, key: PRNGKeyArray | None = None) -> None:
    """Checks an algorithm against `detpg.types.Algorithm`, by training on an environment.

    Args:
        algorithm: What is to be checked.
        environment: Where it is trained; one that `check_environment` accepts.
        key: Source of the runs; seed 0 when not given.

    Raises:
        AssertionError: What was found, what was expected and how to mend it.
    """
    key = jax.random.key(0) if key is None else key
    check_protocol(algorithm, Algorithm)
    _check_description(algorithm)
    _check_hyper_parameters(algorithm)
    before = snapshot(algorithm)

    def first(key: PRNGKeyArray) -> dict[str, PyTree]:
        return _first_update(algorithm, environment, key)

    seen = first(key)
    check_array("act", seen["act"], (environment.spec.action_size,), jnp.floating)
    check_array("greedy", seen["greedy"], (environment.spec.action_size,), jnp.floating)
    check_kept("update", "init", "update", first, key)
    check_same("a second call with the same key", first(key), seen, PURE)
    check_close("under jax.jit", jax.jit(first)(key), seen)
    check_pure(algorithm, before)
    _check_runs(algorithm, environment, key)


def _check_description(algorithm: Algorithm) -> None:
    name, size = type(algorithm).__name__, algorithm.experience.batch
    mend = "name the paper's equations, or the source, in `equations`"
    require(bool(algorithm.equations.strip()), f"{name}.equations is empty", "a text", mend)
    mend = "return Experience() for a learner that updates at every step"
    require(size >= 1, f"{name}.experience has batches of {size}", "at least 1", mend)


def _check_hyper_parameters(algorithm: Algorithm) -> None:
    """Each is a leaf of a strong type, and refuses what is no finite number."""
    for name in hyper_parameters(algorithm):
        value = getattr(algorithm, name)
        strong = any(value is leaf for leaf in jax.tree.leaves(algorithm))
        strong = strong and isinstance(value, jax.Array) and not value.weak_type
        mend = "declare it with detpg.types.hyper, and not as static"
        require(strong, f"{name} is {value!r}", "a strongly typed array leaf", mend)
        for bad in (math.nan, math.inf):
            said = _refusal(algorithm, name, bad)
            mend = "call detpg.types.check_hyper in __check_init__"
            require(name in said, f"{name} = {bad} met {said}", "a ValueError that names it", mend)


def _refusal(algorithm: Any, name: str, bad: float) -> str:
    try:
        dataclasses.replace(algorithm, **{name: bad})
    except ValueError as error:
        return str(error)
    return "no refusal"


def _experience(
    algorithm: Algorithm, environment: Environment, key: PRNGKeyArray, learner: PyTree
) -> Any:
    """What one update learns from: a transition from the start, or a batch of them."""

    def one(key: PRNGKeyArray) -> Transition:
        start_key, step_key, *act_keys = jax.random.split(key, 4)
        state = environment.initial(start_key)
        action = algorithm.act(act_keys[0], learner, environment.observe(state))
        next_state = environment.transition(step_key, state, action)
        return Transition(
            observation=environment.observe(state),
            action=action,
            reward=environment.reward(state, action, next_state),
            next_observation=environment.observe(next_state),
            next_action=algorithm.act(act_keys[1], learner, environment.observe(next_state)),
            terminated=environment.terminated(next_state),
            truncated=jnp.asarray(environment.spec.time_limit == 1),
        )

    taken = algorithm.experience
    if taken.kind == "each":
        return one(key)
    return lesson(algorithm, jax.vmap(one)(jax.random.split(key, taken.batch)))


def _first_update(
    algorithm: Algorithm, environment: Environment, key: PRNGKeyArray
) -> dict[str, PyTree]:
    init_key, act_key, experience_key, update_key = jax.random.split(key, 4)
    state = algorithm.init(init_key)
    observation = environment.observe(environment.initial(act_key))
    transition = _experience(algorithm, environment, experience_key, state)
    next_state, info = algorithm.update(update_key, state, transition)
    return {
        "init": state,
        "update": next_state,
        "Info": info,
        "act": algorithm.act(act_key, state, observation),
        "greedy": algorithm.greedy(next_state, observation),
    }


def _changed(algorithm: Any, name: str, known: Hyper) -> Any:
    """The algorithm with another allowed value of one hyper-parameter."""
    value = np.asarray(getattr(algorithm, name))
    tried = [value / 2, 2 * value, *(np.full_like(value, x) for x in (known.low, known.high))]
    allowed = [x for x in tried if np.all((known.low <= x) & (x <= known.high) & (x != value))]
    return dataclasses.replace(algorithm, **{name: allowed[0]})


def _check_runs(algorithm: Algorithm, environment: Environment, key: PRNGKeyArray) -> None:
    """One program serves every value and seed, alone, side by side and resumed."""
    steps = NUM_UPDATES * algorithm.experience.steps

    def run(
        algorithm: Algorithm, key: PRNGKeyArray, start: TrainState, times: int = 1
    ) -> TrainState:
        return train(algorithm, environment, key, times * steps, start=start)[0]

    alone, count = counted(run)
    _check_side_by_side(algorithm, environment, key, run, alone)

    start = begin(algorithm, environment, key)
    half = alone(algorithm, key, start)
    loaded = jax.tree.map(_through_file, half)
    whole = jax.jit(run, static_argnames="times")(algorithm, key, start, times=2)
    mend = "keep in the State everything that the next update reads, as plain arrays"
    check_same("a saved and loaded run", loaded, half, mend)
    check_same("a resumed run", alone(algorithm, key, loaded), whole, mend)
    # Equal static parts that are not the same objects must be found equal.
    check_same("a copy", alone(copy.deepcopy(algorithm), key, start), half, PURE)
    mend = "make hyper-parameters array leaves (detpg.types.hyper) and static parts equal by value"
    found = f"new hyper-parameters, seeds and copies traced train {count()} times"
    require(count() == 1, found, "once", mend)
    _check_ends(algorithm, environment, key, half.learner)


def _check_ends(
    algorithm: Algorithm, environment: Environment, key: PRNGKeyArray, learner: PyTree
) -> None:
    """A terminal s' is not bootstrapped from; one where a time limit cuts is, as any other."""
    seen = _experience(algorithm, environment, key, learner)

    @jax.jit
    def learnt(shift: float, terminated: bool, truncated: bool) -> PyTree:
        """What is learnt, with s' and a' moved away from where they are."""
        told = {
            "next_observation": seen.next_observation + shift,
            "terminated": jnp.full_like(seen.terminated, terminated),
        }
        if isinstance(seen, Transition):  # what is recalled no longer has these
            told["next_action"] = seen.next_action + shift
            told["truncated"] = jnp.full_like(seen.truncated, truncated)
        return algorithm.update(key, learner, dataclasses.replace(seen, **told))[0]

    near, far = (learnt(shift, True, False) for shift in (0.0, 1.0))
    mend = "leave out the value of s' where `terminated`, as detpg.critics.td_error does"
    check_same("another s' where the episode has terminated", far, near, mend)
    mend = "look at `terminated` alone to stop bootstrapping, not at `truncated` or `ended`"
    ongoing, cut = (
        _differ(learnt(0.0, False, limit), learnt(1.0, False, limit)) for limit in (False, True)
    )
    require(cut or not ongoing, "s' was not read where a time limit cuts", "bootstrapping", mend)


def _differ(one: PyTree, other: PyTree) -> bool:
    pairs = zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True)
    return any(bool(np.any(plain(a) != plain(b))) for a, b in pairs)


def _check_side_by_side(
    algorithm: Algorithm,
    environment: Environment,
    key: PRNGKeyArray,
    run: Callable[..., TrainState],
    alone: Callable[..., TrainState],
) -> None:
    """A grid of hyper-parameters by seeds is its runs alone."""
    known = hyper_parameters(algorithm)
    points = [algorithm, *(_changed(algorithm, name, known[name]) for name in known)]
    keys = jax.random.split(key, 2)

    def from_scratch(algorithm: Algorithm, key: PRNGKeyArray) -> TrainState:
        return run(algorithm, key, begin(algorithm, environment, key))

    over_seeds = jax.vmap(from_scratch, in_axes=(None, 0))
    grid = jax.jit(jax.vmap(over_seeds, in_axes=(0, None)))(stack(points), keys)
    start = jax.jit(lambda algorithm, key: begin(algorithm, environment, key))
    for i, point in enumerate(points):
        expected = stack([alone(point, k, start(point, k)) for k in keys])
        found = jax.tree.map(lambda x, i=i: plain(x)[i], grid)
        check_close("under jax.vmap over seeds and hyper-parameters", found, expected)


def _through_file(leaf: Any) -> Any:
    file = io.BytesIO()
    try:
        # Arrays alone, as run directories keep them: nothing that is loaded may carry code.
        np.save(file, leaf, allow_pickle=False)
        file.seek(0)
        return jnp.asarray(np.load(file, allow_pickle=False))
    except (TypeError, ValueError) as error:
        what = f"{type(error).__name__} ({str(error).splitlines()[0]})"
        found = f"saving {jax.typeof(leaf)} met {what}"
        mend = "keep numbers that numpy.save knows, and jax.random.key_data instead of a key"
        raise failure(found, "a State of plain arrays", mend) from error
