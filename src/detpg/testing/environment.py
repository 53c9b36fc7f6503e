"""Conformance of an environment to `detpg.types.Environment`."""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray, PyTree

from detpg.testing.checks import (
    PURE,
    check_array,
    check_close,
    check_kept,
    check_protocol,
    check_pure,
    check_same,
    require,
    snapshot,
    stack,
)
from detpg.types import Action, Environment, EnvironmentSpec


def check_environment(environment: Any, key: PRNGKeyArray | None = None) -> None:
    """Checks an environment against `detpg.types.Environment`.

    Args:
        environment: What is to be checked.
        key: Source of the actions and states that are tried; seed 0 when not given.

    Raises:
        AssertionError: What was found, what was expected and how to mend it.
    """
    key = jax.random.key(0) if key is None else key
    check_protocol(environment, Environment)
    _check_spec(environment.spec)
    before = snapshot(environment)

    def walk(key: PRNGKeyArray) -> dict[str, PyTree]:
        return _walk(environment, key)

    seen = walk(key)
    _check_walk(environment.spec, seen)
    check_kept("transition", "initial", "transition", walk, key)
    check_same("a second call with the same key", walk(key), seen, PURE)
    check_close("under jax.jit", jax.jit(walk)(key), seen)
    keys = jax.random.split(key, 3)
    check_close("under jax.vmap over keys", jax.vmap(walk)(keys), stack([walk(k) for k in keys]))
    check_pure(environment, before)


def _check_spec(spec: EnvironmentSpec) -> None:
    sizes, bounds = (spec.observation_size, spec.action_size), (spec.action_low, spec.action_high)
    lengths = tuple(len(bound) for bound in bounds)
    ordered = all(low <= high for low, high in zip(*bounds))
    m = spec.action_size
    seen = (spec.observation_low, spec.observation_high)
    seen_lengths = tuple(len(bound) for bound in seen)
    known = seen_lengths in ((0, 0), (spec.observation_size,) * 2)
    apart = all(low < high for low, high in zip(*seen))
    rules = [
        ("sizes", sizes, min(sizes) >= 1, "two whole numbers of at least 1"),
        ("lengths of the bounds", lengths, lengths == (m, m), f"{m}, the action_size, for both"),
        ("bounds", bounds, ordered, "action_low <= action_high in every component"),
        ("lengths of the observation bounds", seen_lengths, known, "none, or observation_size"),
        ("observation bounds", seen, apart, "observation_low < observation_high"),
        ("time_limit", spec.time_limit, spec.time_limit >= 1, "at least 1 step"),
        ("discount", spec.discount, 0 <= spec.discount <= 1, "a number from 0 to 1"),
    ]
    for name, value, fine, expected in rules:
        require(fine, f"spec has {name} {value}", expected, "correct the environment's spec")


def _any_action(spec: EnvironmentSpec, key: PRNGKeyArray) -> Action:
    low, high = (jnp.asarray(b, dtype=float) for b in (spec.action_low, spec.action_high))
    return jnp.clip(jax.random.normal(key, (spec.action_size,), dtype=float), low, high)


def _walk(environment: Environment, key: PRNGKeyArray) -> dict[str, PyTree]:
    """One step from the start, and all that the environment says of it."""
    start_key, step_key, action_key = jax.random.split(key, 3)
    state = environment.initial(start_key)
    action = _any_action(environment.spec, action_key)
    next_state = environment.transition(step_key, state, action)
    return {
        "initial": state,
        "transition": next_state,
        "reward": environment.reward(state, action, next_state),
        "terminated": environment.terminated(next_state),
        "terminated at the start": environment.terminated(state),
        "observe": environment.observe(state),
        "observe after a step": environment.observe(next_state),
    }


def _check_walk(spec: EnvironmentSpec, seen: dict[str, PyTree]) -> None:
    for name, value in seen.items():
        if name.startswith("observe"):
            check_array(name, value, (spec.observation_size,), jnp.floating)
        if name.startswith("terminated"):
            check_array(name, value, (), jnp.bool_)
    check_array("reward", seen["reward"], (), jnp.floating)
    started = not bool(seen["terminated at the start"])
    mend = "draw initial states that are not terminal"
    require(started, "initial returned a terminated state", "an episode that can begin", mend)
