"""What does not fit is refused in one sentence, before anything is computed."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, Literal, get_args, get_origin

import jax
from jaxtyping import PyTree

from detpg.types import ActionValue, Policy, StateValue


def check_choices(record: Any) -> None:
    """Refuses an option that is none of those that its annotation, a `Literal`, names.

    Raises:
        ValueError: Names the option, its value and the choices.
    """
    names = (field.name for field in dataclasses.fields(record))
    check_options(type(record), {name: getattr(record, name) for name in names})


def check_options(record: type[Any], options: Mapping[str, Any]) -> None:
    """The same for options by name, before there is a record; a yes or no is one of them too.

    Raises:
        ValueError: Names the option, its value and the choices.
    """
    for field in dataclasses.fields(record):
        if field.name not in options:
            continue
        value = options[field.name]
        if get_origin(field.type) is Literal and value not in get_args(field.type):
            choices = ", ".join(get_args(field.type))
            raise ValueError(f"{field.name} {value!r} is unknown: choose one of {choices}.")
        if field.type is bool and not isinstance(value, bool):
            raise ValueError(f"{field.name} {value!r} is unknown: choose one of True, False.")
        whole = isinstance(value, int) and not isinstance(value, bool)
        if field.type is int and "switch" in field.metadata and not whole:
            raise ValueError(f"{field.name} = {value!r} is no whole number: give one, such as 10.")


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
    shape = shape_of("policy", policy, theta, observation=observation)
    if shape != (action_size,):
        raise ValueError(
            f"The policy's action has shape {shape}, but ({action_size},) is needed: give a policy "
            f"for {action_size} action components."
        )


def check_value(words: str, value: StateValue | ActionValue, **inputs: Any) -> None:
    """Refuses a value that does not take these inputs or is not one number.

    Args:
        words: What it is called.
        value: V^v or Q^w.
        **inputs: Observation, and action of Q, in their order; or their shapes and dtypes.

    Raises:
        ValueError: Names the shape that does not fit.
    """
    weights = jax.eval_shape(value.init, jax.random.key(0))
    shape = shape_of(words, value, weights, **inputs)
    if shape != ():
        raise ValueError(
            f"The {words} has shape {shape}, but it must be one number, of shape (): give one that "
            "returns a scalar."
        )


def shape_of(
    words: str, function: Callable[..., Any], *parameters: Any, **inputs: Any
) -> tuple[int, ...]:
    """The shape of what a function returns.

    Raises:
        ValueError: A function that does not take these inputs, or does not return one array.
    """
    try:
        found = jax.eval_shape(function, *parameters, *inputs.values())
    except (TypeError, ValueError) as error:
        sizes = " and an ".join(f"{name} of shape {x.shape}" for name, x in inputs.items())
        raise ValueError(
            f"The {words} does not take an {sizes}: give a {words} for that size."
        ) from error
    if not isinstance(found, jax.ShapeDtypeStruct):
        raise ValueError(
            f"The {words} returns a {type(found).__name__}: give a {words} that returns one array."
        )
    return tuple(found.shape)


def shapes(tree: PyTree) -> list[tuple[int, ...]]:
    """Of the leaves, in their order."""
    return [tuple(leaf.shape) for leaf in jax.tree.leaves(tree)]
