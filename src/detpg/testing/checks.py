"""The checks that environments and algorithms share, each one sentence when it fails."""

import inspect
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

# Batched and single programs round differently; a run that leaks into its neighbour is off by far
# more than this part of the largest number (or of SMALL, where all numbers are near nought).
TOLERANCE = 1e-3
SMALL = 1e-2

PURE = "let numbers depend on the arguments only, and chance on the key only"


def failure(found: str, expected: str, mend: str) -> AssertionError:
    """The one sentence."""
    return AssertionError(f"{found}, but {expected} was expected: {mend}.")


def require(fine: bool, found: str, expected: str, mend: str) -> None:
    """Raises the one sentence unless all is fine."""
    if not fine:
        raise failure(found, expected, mend)


def check_protocol(record: Any, protocol: Any) -> None:
    """Every method is there and its arguments carry the protocol's names, in order."""
    kind, expected = type(record).__name__, protocol.__name__
    members = {name: value for name, value in vars(protocol).items() if _is_member(name, value)}
    missing = [name for name in (*members, *_constants(protocol)) if not hasattr(record, name)]
    fine = isinstance(record, protocol) and not missing
    mend = f"add {', '.join(missing)}" if missing else "make them methods"
    require(fine, f"{kind} is not an {expected}", "every member of the protocol", mend)
    for name, value in members.items():
        if isinstance(value, property):
            continue
        wanted = [n for n in inspect.signature(getattr(protocol, name)).parameters if n != "self"]
        given = inspect.signature(getattr(record, name)).parameters
        spare = [p for p in list(given.values())[len(wanted) :] if p.default is p.empty]
        require(
            list(given)[: len(wanted)] == wanted and not spare,
            f"{kind}.{name} takes ({', '.join(given)})",
            f"({', '.join(wanted)})",
            "name and order its arguments as in detpg.types",
        )


def _is_member(name: str, value: Any) -> bool:
    kinds = (property, classmethod)
    return not name.startswith("_") and (inspect.isfunction(value) or isinstance(value, kinds))


def _constants(protocol: Any) -> list[str]:
    return [name for name in inspect.get_annotations(protocol) if not name.startswith("_")]


def check_array(name: str, value: Any, shape: tuple[int, ...], kind: Any) -> None:
    """One returned value has the shape and the kind of number that the protocol says."""
    dtype = getattr(value, "dtype", None)
    require(
        dtype is not None and value.shape == shape and bool(jnp.issubdtype(dtype, kind)),
        f"{name} returned {type(value).__name__ if dtype is None else f'{dtype}{value.shape}'}",
        f"an array of shape {shape} and kind {kind.__name__}",
        f"make {name} return that, or correct the spec",
    )


def check_kept(
    verb: str, old: str, new: str, play: Callable[[Any], dict[str, PyTree]], key: Any
) -> None:
    """Structure, shapes, dtypes and weak types of the state stay.

    That is what `jax.lax.scan` asks of what it carries, and what saves a second trace.
    """
    try:
        shapes = jax.eval_shape(play, key)
    except jax.errors.JAXTypeError as error:
        found = f"tracing met {type(error).__name__} ({str(error).splitlines()[0]})"
        mend = "replace Python branches on values by jnp.where, and numpy by jax.numpy"
        raise failure(found, "code that jax.jit can trace", mend) from error
    before, after = _describe(shapes[old]), _describe(shapes[new])
    mend = f"make {verb} return the structure, shapes and dtypes that {old} returns"
    require(after == before, f"{verb} returned {after}", before, mend)
    same = jax.tree.structure(shapes[old]) == jax.tree.structure(shapes[new])
    mend = "compare static parts by value, and leave them as they are"
    require(same, f"{verb} returned other static parts", f"those of {old}", mend)
    weak = any(leaf.weak_type for leaf in jax.tree.leaves(shapes[old]))
    mend = "build its arrays with an explicit dtype, as jnp.asarray(x, dtype=float) does"
    require(not weak, f"{old} returned weakly typed arrays", "only strongly typed ones", mend)


def check_same(where: str, found: PyTree, expected: PyTree, mend: str) -> None:
    """Two trees are equal to the bit."""
    for path, one, other in _pairs(found, expected):
        same = one.dtype == other.dtype and one.tobytes() == other.tobytes()
        require(same, f"{where} gave another {path}", "the same to the bit", mend)


def check_close(where: str, found: PyTree, expected: PyTree) -> None:
    """Two trees are equal up to rounding."""
    for path, one, other in _pairs(found, expected):
        one, other = one.astype(float), other.astype(float)
        size = np.max(np.abs(other), where=np.isfinite(other), initial=SMALL)
        close = np.allclose(one, other, rtol=TOLERANCE, atol=TOLERANCE * size, equal_nan=True)
        with np.errstate(invalid="ignore"):  # a run that diverged on both sides
            off = np.max(np.abs(one - other), initial=0.0)
        mend = "use jax.numpy throughout, without Python branches on values or state outside"
        require(close, f"{where}, {path} is off by {off:g}", "what single plain calls give", mend)


def check_pure(record: Any, before: PyTree) -> None:
    """The record holds what it held when the snapshot was taken."""
    name = type(record).__name__
    mend = "keep what changes in the state, and freeze the record"
    after = snapshot(record)
    same = jax.tree.structure(before) == jax.tree.structure(after)
    same = same and all(_equal(*pair) for pair in zip(*map(jax.tree.leaves, (before, after))))
    require(same, f"{name} changed while it was used", "a record that stays as it is", mend)


def counted(function: Callable[..., Any]) -> tuple[Callable[..., Any], Callable[[], int]]:
    """The compiled function, and how often it was traced."""
    traces: list[None] = []

    def noting(*arguments: Any) -> Any:
        traces.append(None)
        return function(*arguments)

    return jax.jit(noting), lambda: len(traces)


def stack(trees: list[Any]) -> Any:
    """Trees of one structure as one tree of NumPy arrays with a leading axis."""
    return jax.tree.map(lambda *leaves: np.stack([plain(leaf) for leaf in leaves]), *trees)


def _describe(shapes: PyTree) -> str:
    """Each leaf by its path, such as `.theta float32[3]`."""
    leaves = jax.tree.leaves_with_path(shapes)
    weak = [", weak" if leaf.weak_type else "" for _, leaf in leaves]
    paths = [jax.tree_util.keystr(path) for path, _ in leaves]
    return "; ".join(
        f"{path} {leaf.dtype}{list(leaf.shape)}{mark}".lstrip()
        for path, (_, leaf), mark in zip(paths, leaves, weak)
    )


def plain(leaf: Any) -> np.ndarray:
    """A number, array or key as a NumPy array."""
    is_key = isinstance(leaf, jax.Array) and jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key)
    return np.asarray(jax.random.key_data(leaf) if is_key else leaf)


def _pairs(found: PyTree, expected: PyTree) -> list[tuple[str, np.ndarray, np.ndarray]]:
    ones, others = jax.tree.leaves_with_path(found), jax.tree.leaves(expected)
    paths = [jax.tree_util.keystr(path).lstrip(".") for path, _ in ones]
    return [(p, plain(a), plain(b)) for p, (_, a), b in zip(paths, ones, others, strict=True)]


def snapshot(record: Any) -> PyTree:
    """What the record holds: arrays as copies, anything else as it is."""
    held = dict(getattr(record, "__dict__", {}))
    is_array = (np.ndarray, jax.Array)
    return jax.tree.map(lambda x: np.array(plain(x)) if isinstance(x, is_array) else x, held)


def _equal(before: Any, after: Any) -> bool:
    if isinstance(before, np.ndarray):
        return before.shape == after.shape and before.tobytes() == after.tobytes()
    return before is after or before == after
