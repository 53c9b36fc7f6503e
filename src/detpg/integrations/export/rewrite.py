"""A function of JAX, written without what ONNX does not have or leaves open."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax.core import Tracer
from jax.extend.core import ClosedJaxpr, Jaxpr, Literal, jaxpr_as_fun
from jaxtyping import Array

INNER = ("jaxpr", "call_jaxpr", "fun_jaxpr")
CALLS = ("jit", "pjit", "closed_call", "core_call", "custom_jvp_call", "custom_vjp_call", "remat2")


def rewritten(function: Callable, *examples: jax.ShapeDtypeStruct) -> Callable[..., list[Array]]:
    """The same function of the same shapes; its results as a list.

    What does not depend on the input is computed now, calls are laid open, and a few operations are
    put in other words (`RULES`).
    """
    closed = jax.make_jaxpr(function)(*examples)
    return lambda *inputs: _evaluated(closed, inputs)


def _evaluated(closed: ClosedJaxpr, inputs: Sequence[Any]) -> list[Any]:
    values: dict[Any, Any] = dict(zip(closed.jaxpr.constvars, closed.consts))
    values |= dict(zip(closed.jaxpr.invars, inputs))

    def read(variable: Any) -> Any:
        return variable.val if isinstance(variable, Literal) else values[variable]

    for equation in closed.jaxpr.eqns:
        results = _result(equation, [read(variable) for variable in equation.invars])
        values |= dict(zip(equation.outvars, results))
    return [read(variable) for variable in closed.jaxpr.outvars]


def _result(equation: Any, inputs: list[Any]) -> Sequence[Any]:
    name, params = equation.primitive.name, equation.params
    inner = next((params[key] for key in INNER if key in params), None)
    if name in CALLS and isinstance(inner, ClosedJaxpr):
        return _evaluated(inner, inputs)
    if not any(isinstance(value, Tracer) for value in inputs):
        with jax.ensure_compile_time_eval():
            return _bound(equation, inputs)
    rule = RULES.get(name)
    result = rule(*inputs, **params) if rule is not None else None
    return [result] if result is not None else _bound(equation, inputs)


def _bound(equation: Any, inputs: list[Any]) -> Sequence[Any]:
    """The operation as it is."""
    found = zip(equation.invars, inputs)
    given = {variable: value for variable, value in found if not isinstance(variable, Literal)}
    alone = Jaxpr((), list(given), equation.outvars, [equation], equation.effects)
    return jaxpr_as_fun(ClosedJaxpr(alone, ()))(*given.values())


def _to_integer(value: Array, *, new_dtype: Any, **_: Any) -> Array | None:
    """As XLA does it: 0 for NaN, the nearest integer there is for what is too large.

    ONNX leaves these cases open, and its runtimes differ.
    """
    whole = jnp.issubdtype(new_dtype, jnp.integer)
    if not (whole and jnp.issubdtype(value.dtype, jnp.floating)):
        return None
    limits = jnp.iinfo(new_dtype)
    # Powers of two (or 0), so exact in float32; `limits.max` itself is not.
    least, beyond = (jnp.asarray(x, value.dtype) for x in (limits.min, limits.max + 1))
    within = (value >= least) & (value < beyond)
    inside = jnp.where(within, value, jnp.zeros_like(value)).astype(new_dtype)
    low, high = (jnp.full(value.shape, x, new_dtype) for x in (limits.min, limits.max))
    return jnp.where(value >= beyond, high, jnp.where(value < least, low, inside))


def _scatter_add(operand: Array, indices: Array, updates: Array, **params: Any) -> Array | None:
    """x.at[indices].add(updates)."""
    if not _of_vectors(operand, indices, updates, **params):
        return None
    return operand + jnp.sum(_placed(operand, indices, updates), 0, operand.dtype)


def _scatter(operand: Array, indices: Array, updates: Array, **params: Any) -> Array | None:
    """x.at[indices].set(updates)."""
    if not _of_vectors(operand, indices, updates, **params):
        return None
    found = jnp.sum(_placed(operand, indices, updates), 0, operand.dtype)
    return jnp.where(jnp.any(_points(operand, indices), 0), found, operand)


def _of_vectors(
    operand: Array, indices: Array, updates: Array, *, dimension_numbers: Any, mode: Any, **_: Any
) -> bool:
    """Whether numbers go into a vector, one to each index; batched, ONNX has no such scatter."""
    drop = (jax.lax.GatherScatterMode.FILL_OR_DROP, jax.lax.GatherScatterMode.PROMISE_IN_BOUNDS)
    singly = operand.ndim == 1 and indices.size == updates.size
    return singly and dimension_numbers.update_window_dims == () and mode in drop


def _points(operand: Array, indices: Array) -> Array:
    """For each index, where it points to."""
    return indices.reshape(-1, 1) == jnp.arange(operand.size, dtype=indices.dtype)[None, :]


def _placed(operand: Array, indices: Array, updates: Array) -> Array:
    """Each number in its place, zeros elsewhere."""
    points, numbers = _points(operand, indices), updates.reshape(-1, 1)
    if not isinstance(updates, Tracer):  # 1, of a tile coder: no table of constants
        return points.astype(updates.dtype) * numbers
    return jnp.where(points, numbers, jnp.zeros_like(numbers))


def _remainder(value: Array, divisor: Array, **_: Any) -> Array:
    """Value - divisor times the whole part of their quotient.

    The converter's own remainder knows no batch of unknown size.
    """
    quotient = jax.lax.div(value, divisor)
    whole = jnp.trunc(quotient) if jnp.issubdtype(value.dtype, jnp.floating) else quotient
    return jax.lax.sub(value, jax.lax.mul(divisor, whole))


def _angle(y: Array, x: Array, **_: Any) -> Array:
    """The angle of (x, y); infinite in both, it is that of the signs."""
    both = jnp.isinf(y) & jnp.isinf(x)
    y, x = (jnp.where(both, jnp.sign(value), value) for value in (y, x))
    return jax.lax.atan2(y, x)


RULES: dict[str, Callable[..., Array | None]] = {
    "atan2": _angle,
    "convert_element_type": _to_integer,
    "rem": _remainder,
    "scatter": _scatter,
    "scatter-add": _scatter_add,
}
