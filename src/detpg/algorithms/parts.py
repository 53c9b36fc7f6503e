"""The parts of a learner: those it gets when none are named, and whether given ones fit."""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, PRNGKeyArray

from detpg import trees
from detpg.actors.deterministic import deterministic_direction
from detpg.checks import check_action, check_choices, check_value, shape_of
from detpg.critics.action_values import QuadraticActionValue
from detpg.critics.state_values import QuadraticStateValue
from detpg.experience import Experience
from detpg.features.quadratic import QuadraticFeatures
from detpg.policies.behaviour import GaussianBehaviour, cap
from detpg.policies.feature_gaussian import FeatureGaussian
from detpg.policies.linear import LinearPolicy
from detpg.policies.mlp import MLPPolicy
from detpg.types import (
    Action,
    ActionValue,
    Bounds,
    EnvironmentSpec,
    Observation,
    Policy,
    Transition,
    check_hyper,
)

NUM_TRIED = 32  # actions at which a critic's slope is looked at
NUM_UPDATES = 4  # of a critic, after which it has a slope or never will


def network(spec: EnvironmentSpec, hidden: tuple[int, ...] = (32,)) -> MLPPolicy:
    """A policy whose actions stay in the box where they are in units of it."""
    m = spec.action_size
    in_units = spec.bounds == ((-1.0,) * m, (1.0,) * m)
    return MLPPolicy(spec.observation_size, m, hidden, output="tanh" if in_units else "linear")


def incompatible_parts(spec: EnvironmentSpec) -> dict[str, Any]:
    """Linear policy, quadratic Q(s, a), the environment's discount."""
    sizes = spec.observation_size, spec.action_size
    return {
        "policy": LinearPolicy(*sizes),
        "action_value": QuadraticActionValue(*sizes),
        "gamma": spec.discount,
    }


def compatible_parts(spec: EnvironmentSpec) -> dict[str, Any]:
    """Linear policy, quadratic V(s), the environment's discount."""
    return {
        "policy": LinearPolicy(spec.observation_size, spec.action_size),
        "state_value": QuadraticStateValue(spec.observation_size),
        "bounds": spec.bounds,
        "gamma": spec.discount,
    }


def feature_parts(spec: EnvironmentSpec, options: dict[str, Any]) -> dict[str, Any]:
    """Quadratic features and the environment's discount, unless given; refused if they do not fit.

    Raises:
        ValueError: Features of the wrong size, or another number of action components.
    """
    features = QuadraticFeatures(spec.observation_size)
    defaults = {"features": features, "action_size": spec.action_size, "gamma": spec.discount}
    parts = defaults | options
    _check_action_size(spec, "action_size", parts["action_size"])
    observation = jnp.zeros(spec.observation_size)
    found = shape_of("feature map", parts["features"], observation=observation)
    if found != (parts["features"].size,):
        raise ValueError(
            f"The features of an observation have shape {found}, but their size is said to be "
            f"{parts['features'].size}: give features that return a vector of that size."
        )
    return parts


@property
def incremental(learner: Any) -> Experience:
    """The `experience` of a learner that takes each transition once, as it happens."""
    return Experience()


@property
def feature_gaussian(learner: Any) -> FeatureGaussian:
    """pi_u of a stochastic learner: a Gaussian on its features."""
    return FeatureGaussian(learner.features, learner.action_size, learner.sigma0)


def behaviour(learner: Any) -> GaussianBehaviour:
    """Beta of a learner: noise of its width and correlation around its policy."""
    return GaussianBehaviour(learner.policy, learner.sigma, learner.correlation)


def seen(learner: Any, transition: Transition) -> tuple[Observation, Action, Observation]:
    """s, a, s', with the action as drawn, or as the world capped it (docs/decisions/0014)."""
    action = transition.action
    action = cap(action, learner.bounds) if learner.capped else action
    return transition.observation, action, transition.next_observation


def validate(learner: Any) -> None:
    """Refuses a learner whose options, hyper-parameters, bounds or widths cannot be.

    Raises:
        ValueError: Names the one that cannot be, and what would.
    """
    check_choices(learner)
    check_hyper(learner)
    if not hasattr(learner, "bounds"):
        return
    low, high = learner.bounds
    if len(low) != len(high) or not all(least <= most for least, most in zip(low, high)):
        raise ValueError(
            f"The bounds {low} and {high} are no box: give a low and a high end for each action "
            "component, low <= high."
        )
    if learner.sigma.shape not in ((), (len(low),)):
        raise ValueError(
            f"sigma has shape {learner.sigma.shape}, but the actions have {len(low)} components: "
            "give one number, or one for each component."
        )


def checked(spec: EnvironmentSpec, parts: dict[str, Any]) -> dict[str, Any]:
    """The same parts, refused in one sentence if they do not fit the environment or each other.

    Raises:
        ValueError: A policy, a value or bounds of the wrong shape, or a Q that ignores the action.
    """
    observation, action = jnp.zeros(spec.observation_size), jnp.zeros(spec.action_size)
    theta = jax.eval_shape(parts["policy"].init, jax.random.key(0))
    check_action(parts["policy"], theta, observation, spec.action_size)
    if "bounds" in parts:
        _check_action_size(spec, "the length of the bounds", len(parts["bounds"].low))
    if "state_value" in parts:
        check_value("state value", parts["state_value"], observation=observation)
    if "action_value" in parts:
        inputs = {"observation": observation, "action": action}
        check_value("action value", parts["action_value"], **inputs)
        if not _reads_action(parts["action_value"], spec):
            raise ValueError(
                "The action value Q(s, a) does not change with a, so its action gradient is zero "
                "and the actor would never move: give one that reads the action."
            )
    return parts


def check_moves(spec: EnvironmentSpec, parts: dict[str, Any]) -> None:
    """Refuses a policy and a critic that stay where they start, without noise.

    Raises:
        ValueError: All first actions are 0, and from them the critic learns no slope
            (docs/decisions/0037).
    """
    if not _moves(spec, parts["policy"], parts["action_value"]):
        raise ValueError(
            "The policy would never move: all its first actions are 0, and without noise the "
            "critic learns from them no slope in a; give a policy that starts elsewhere, such as "
            "MLPPolicy (--policy mlp), or a critic that is a network, MLPActionValue (--value mlp)."
        )


def _moves(spec: EnvironmentSpec, policy: Policy, action_value: ActionValue) -> bool:
    """Whether an action is not 0, or the actor's direction after some updates of the critic."""
    box = Bounds(spec.observation_low, spec.observation_high)
    box = box if len(box.low) == spec.observation_size else Bounds.unbounded(spec.observation_size)
    with jax.ensure_compile_time_eval():
        keys = jax.random.split(jax.random.key(0), NUM_UPDATES + 2)
        theta, w = policy.init(keys[0]), action_value.init(keys[1])
        for key in keys[2:]:
            s = _inside(key, box)
            action = policy(theta, s)
            if jnp.any(action != 0):
                return True
            w = trees.add_scaled(w, jnp.ones(()), jax.grad(action_value)(w, s, action))
            direction = deterministic_direction(policy, theta, s, partial(action_value, w, s))
            if any(bool(jnp.any(leaf != 0)) for leaf in jax.tree.leaves(direction)):
                return True
    return False


def _check_action_size(spec: EnvironmentSpec, words: str, found: int) -> None:
    if found != spec.action_size:
        raise ValueError(
            f"{words} is {found}, but environment {spec.name!r} has {spec.action_size} action "
            f"components: give {spec.action_size}, or leave it out."
        )


def _reads_action(action_value: ActionValue, spec: EnvironmentSpec) -> bool:
    """Whether grad_a Q is not zero somewhere, for weights, states and actions drawn at random.

    Evaluated at once also under `jit`, where learners are made for each point of a grid.
    """

    def slope(key: PRNGKeyArray) -> Action:
        keys = jax.random.split(key, 4)
        w = jax.tree.map(partial(_drawn, keys[0]), action_value.init(keys[1]))
        observation = jax.random.normal(keys[2], (spec.observation_size,))
        action = _inside(keys[3], spec.bounds)
        return jax.grad(action_value, argnums=2)(w, observation, action)

    with jax.ensure_compile_time_eval():
        keys = jax.random.split(jax.random.key(0), NUM_TRIED)
        # One after the other: the first nearly always tells, and weights may be many.
        return any(bool(jnp.any(slope(key) != 0)) for key in keys)


def _drawn(key: PRNGKeyArray, weight: Array) -> Array:
    """A normal weight of the same shape; one that is no real number stays as it is."""
    real = jnp.issubdtype(weight.dtype, jnp.floating)
    return jax.random.normal(key, weight.shape, weight.dtype) if real else weight


def _inside(key: PRNGKeyArray, bounds: Bounds) -> Array:
    """A vector: uniform between two bounds, else normal."""
    low, high = (jnp.asarray(bound, dtype=float) for bound in bounds)
    between = low + jax.random.uniform(key, low.shape) * (high - low)
    normal = cap(jax.random.normal(key, low.shape), bounds)
    return jnp.where(jnp.isfinite(high - low), between, normal)
