"""Named arrays in one file: whole or absent, and without any code in it."""

import io
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from detpg.runs.directory import write_atomically


def plain(leaf: Any) -> np.ndarray:
    """A leaf of a state as numbers; of a key its data."""
    return np.asarray(jax.random.key_data(leaf) if _is_key(leaf) else leaf)


def typed(found: np.ndarray, leaf: Any) -> Any:
    """What `plain` made of a leaf like this one, as a leaf again."""
    return jax.random.wrap_key_data(jnp.asarray(found)) if _is_key(leaf) else jnp.asarray(found)


def _is_key(leaf: Any) -> bool:
    return jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key)


def numbered(tree: PyTree) -> dict[str, np.ndarray]:
    """The leaves of a tree by number, as they are written."""
    return {f"leaf{i}": plain(leaf) for i, leaf in enumerate(jax.tree.leaves(tree))}


def write_arrays(path: Path, arrays: Mapping[str, Any]) -> None:
    """Writes arrays, by name, as one `.npz` file."""
    content = io.BytesIO()
    np.savez(content, **dict(arrays))
    write_atomically(path, lambda file: file.write(content.getbuffer()))


def read_arrays(path: Path, only: Collection[str] | None = None) -> dict[str, np.ndarray] | None:
    """What `write_arrays` wrote; None where it is absent or damaged.

    Args:
        path: The file.
        only: Names to read; all when not given.
    """
    try:
        with path.open("rb") as file:
            # Arrays of numbers alone: an array of objects could carry code.
            kept = np.load(file, allow_pickle=False)
            return {name: kept[name] for name in (kept.files if only is None else only)}
    except (OSError, ValueError, EOFError, KeyError, BadZipFile):
        return None
