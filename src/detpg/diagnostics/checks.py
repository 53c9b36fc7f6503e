"""What does not fit is refused in one sentence, before anything is computed."""

from typing import Any

import jax
from jaxtyping import PyTree

from detpg.types import Policy


def check_theta(policy: Policy, theta: PyTree) -> None:
    """Refuses parameters that are not shaped like the policy's own.

    Raises:
        ValueError: Another structure or other shapes than `policy.init` gives.
    """
    own = jax.eval_shape(policy.init, jax.random.key(0))
    if jax.tree.structure(own) != jax.tree.structure(theta) or shapes(own) != shapes(theta):
        raise ValueError(
            f"theta has leaves of shapes {shapes(theta)}, but the policy's own are {shapes(own)}: "
            "give parameters shaped like policy.init's."
        )


def check_action(policy: Policy, theta: PyTree, observation: Any, action_size: int) -> None:
    """Refuses a policy that does not take these observations or give these actions.

    Args:
        policy: mu_theta.
        theta: Its parameters.
        observation: One, or its shape and dtype.
        action_size: Number of action components that are needed.

    Raises:
        ValueError: Names the shape that does not fit.
    """
    try:
        shape = jax.eval_shape(policy, theta, observation).shape
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"The policy does not take an observation of shape {observation.shape}: give a policy "
            "for observations of that size."
        ) from error
    if shape != (action_size,):
        raise ValueError(
            f"The policy's action has shape {shape}, but ({action_size},) is needed: give a policy "
            f"for {action_size} action components."
        )


def shapes(tree: PyTree) -> list[tuple[int, ...]]:
    """Of the leaves, in their order."""
    return [tuple(leaf.shape) for leaf in jax.tree.leaves(tree)]
