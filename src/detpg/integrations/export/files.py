"""From a controller to a file that was tested before it is there."""

from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, Literal

import jax
import jax.numpy as jnp

from detpg.integrations.export.describe import load_json, to_json
from detpg.integrations.export.loaded import Loaded
from detpg.integrations.export.parity import Parity, parity
from detpg.integrations.export.parts import about, single_precision, single_precision_mode
from detpg.integrations.export.to_jax import load_jax, to_jax
from detpg.integrations.export.to_onnx import load_onnx, to_onnx
from detpg.runs import write_atomically
from detpg.types import EnvironmentSpec
from detpg.wrappers import Controller

Kind = Literal["onnx", "jax", "json"]
KINDS: dict[Kind, tuple[Callable[..., bytes], Callable[[Path], Loaded]]] = {
    "onnx": (to_onnx, load_onnx),
    "jax": (to_jax, load_jax),
    "json": (to_json, load_json),
}


def export(
    controller: Controller,
    observation_size: int,
    path: Path,
    kind: Kind,
    spec: EnvironmentSpec | None = None,
) -> Parity:
    """Writes a controller to a file, and puts it in place if it answers as the training code does.

    Args:
        controller: Observation in, action out.
        observation_size: d.
        path: The file; one that is there is replaced.
        kind: "onnx" for onnxruntime and others, "jax" for JAX, "json" to read and for NumPy.
        spec: Of the environment: its name goes into the file, its observations into the test.

    Returns:
        How far the file is from the training code.

    Raises:
        ImportError: `kind` is "onnx" and the extra is not installed.
        ValueError: A controller that this kind cannot hold, that diverged, that does not take such
            observations, or whose file answers otherwise; nothing was put in place.
    """
    if kind not in KINDS:
        raise ValueError(f"The format {kind!r} is unknown: choose one of {', '.join(KINDS)}.")
    convert, load = KINDS[kind]
    with single_precision_mode():
        controller = single_precision(controller)
        _check_size(controller, observation_size)
        content = convert(controller, about(controller, observation_size, spec))

    found: list[Parity] = []

    def write_and_test(file: IO[bytes]) -> None:
        file.write(content)
        file.flush()
        found.append(parity(controller, observation_size, load(Path(file.name)).run, spec))
        _check(found[0], path)

    write_atomically(Path(path), write_and_test)
    return found[0]


def _check_size(controller: Controller, size: int) -> None:
    wanted = (len(controller.bounds.low),)
    try:
        made: Any = jax.eval_shape(lambda s: controller(s), jnp.zeros(size, jnp.float32)).shape
    except (TypeError, ValueError, IndexError):
        made = None
    if made != wanted:
        raise ValueError(
            f"The controller makes no action of shape {wanted} from an observation of size {size}: "
            "give the size that it was trained with."
        )


def _check(found: Parity, path: Path) -> None:
    if not found.equal:
        seen = ", ".join(f"{x:g}" for x in found.excess_observation)
        raise ValueError(
            f"{path} was not written: at the observation ({seen}) its action differs from the "
            f"training code's by {found.excess_difference:g} half ranges, {found.excess:.3g} times "
            "what rounding explains."
        )
