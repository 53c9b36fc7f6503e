"""JAX's own format: the compiled controller as StableHLO, behind one line of JSON."""

import hashlib
import json
from pathlib import Path
from typing import Any

import jax
import numpy as np

from detpg.integrations.export.loaded import Loaded
from detpg.integrations.export.parts import deployed
from detpg.wrappers import Controller

FORMAT = "detpg controller, jax.export"
PLATFORMS = ("cpu", "cuda", "rocm", "tpu")
LONGEST = 2**20  # bytes of a header; one that goes on is another kind of file


def to_jax(controller: Controller, about: dict[str, Any]) -> bytes:
    """A line of JSON, and what `jax.export.deserialize` reads: [N, d] to [N, m], for any N.

    Raises:
        ValueError: A policy that JAX cannot export.
    """
    shape = jax.export.symbolic_shape(f"N, {about['observation_size']}")
    many = jax.ShapeDtypeStruct(shape, np.float32)
    function = jax.jit(jax.vmap(deployed(controller)))
    try:
        exported = jax.export.export(function, platforms=PLATFORMS)(many)
    except Exception as error:  # whatever stands in a user's function
        first = (str(error).strip().splitlines() or ["no message"])[0]
        raise ValueError(
            f"JAX cannot export the controller ({type(error).__name__}: {first}): write its "
            "policy with other operations."
        ) from error
    program = bytes(exported.serialize())
    header = about | {"format": FORMAT, "sha256": hashlib.sha256(program).hexdigest()}
    return json.dumps(header).encode() + b"\n" + program


def load_jax(path: Path) -> Loaded:
    """A controller that was exported with JAX; nothing in the file is executed by loading it.

    Raises:
        ValueError: The file is no such controller, or was damaged.
    """
    with Path(path).open("rb") as file:
        line, program = file.readline(LONGEST), file.read()
    try:
        about = json.loads(line)
        if about.pop("format") != FORMAT:
            raise ValueError(about)
        digest = about.pop("sha256")
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ValueError(
            f"{path} is no controller that detpg exported with JAX: give such a file."
        ) from error
    if hashlib.sha256(program).hexdigest() != digest:
        raise ValueError(f"{path} is damaged: export the controller again.")
    exported = jax.export.deserialize(bytearray(program))
    return Loaded(about, lambda seen: exported.call(jax.numpy.asarray(seen)))
