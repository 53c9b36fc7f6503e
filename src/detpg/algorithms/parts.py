"""The parts that a learner gets when none are named: enough for a linear-quadratic problem."""

from typing import Any

from detpg.critics.action_values import QuadraticActionValue
from detpg.critics.state_values import QuadraticStateValue
from detpg.policies.linear import LinearPolicy
from detpg.types import EnvironmentSpec


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
        "gamma": spec.discount,
    }
