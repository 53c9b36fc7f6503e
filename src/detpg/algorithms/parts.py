"""The parts of a learner: those it gets when none are named, and whether given ones fit."""

from typing import Any

import jax
import jax.numpy as jnp

from detpg.critics.action_values import QuadraticActionValue
from detpg.critics.state_values import QuadraticStateValue
from detpg.features.quadratic import QuadraticFeatures
from detpg.policies.behaviour import GaussianBehaviour, cap
from detpg.policies.feature_gaussian import FeatureGaussian
from detpg.policies.linear import LinearPolicy
from detpg.types import Action, ActionValue, EnvironmentSpec, Observation, Transition


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
        ValueError: Features of the wrong size.
    """
    features = QuadraticFeatures(spec.observation_size)
    defaults = {"features": features, "action_size": spec.action_size, "gamma": spec.discount}
    parts = defaults | options
    found = jax.eval_shape(parts["features"], jnp.zeros(spec.observation_size)).shape
    if found != (parts["features"].size,):
        raise ValueError(
            f"The features of an observation have shape {found}, but their size is said to be "
            f"{parts['features'].size}: give features that return a vector of that size."
        )
    return parts


@property
def incremental(learner: Any) -> None:
    """The `batch_size` of a learner that takes one transition per update."""
    return


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


def checked(spec: EnvironmentSpec, parts: dict[str, Any]) -> dict[str, Any]:
    """The same parts, refused in one sentence if they do not fit the environment or each other.

    Raises:
        ValueError: A policy whose action has the wrong shape, or a Q that ignores the action.
    """
    key, observation = jax.random.key(0), jnp.zeros(spec.observation_size)
    policy = parts["policy"]
    action = jax.eval_shape(lambda k: policy(policy.init(k), observation), key)
    if action.shape != (spec.action_size,):
        raise ValueError(
            f"The policy's action has shape {action.shape}, but environment {spec.name!r} takes "
            f"({spec.action_size},): give a policy for {spec.action_size} action components."
        )
    if "action_value" in parts and not _reads_action(parts["action_value"], spec):
        raise ValueError(
            "The action value Q(s, a) does not change with a, so its action gradient is zero and "
            "the actor would never move: give one that reads the action."
        )
    return parts


def _reads_action(action_value: ActionValue, spec: EnvironmentSpec) -> bool:
    """Whether grad_a Q is not zero somewhere, for weights drawn at random.

    Evaluated at once also under `jit`, where learners are made for each point of a grid.
    """
    with jax.ensure_compile_time_eval():
        keys = jax.random.split(jax.random.key(0), 3)
        w = jax.tree.map(
            lambda x: jax.random.normal(keys[0], x.shape, x.dtype), action_value.init(keys[0])
        )
        observation = jax.random.normal(keys[1], (spec.observation_size,))
        action = jax.random.normal(keys[2], (spec.action_size,))
        gradient = jax.grad(action_value, argnums=2)(w, observation, action)
        return bool(jnp.any(gradient != 0))
