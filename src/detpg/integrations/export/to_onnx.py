"""ONNX: a controller for onnxruntime and whatever else reads the format."""

import importlib.util
import json
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import jax
import numpy as np

from detpg.integrations.export.loaded import Loaded
from detpg.integrations.export.parts import deployed
from detpg.integrations.export.rewrite import rewritten
from detpg.wrappers import Controller

OPSET = 18  # the first with operations on bits, which a hashed tile coder needs
INPUT, OUTPUT, ABOUT = "observation", "action", "detpg"
NEEDED = ("jax2onnx", "onnx", "onnxruntime")


def to_onnx(controller: Controller, about: dict[str, Any]) -> bytes:
    """The controller as an ONNX model: `observation` float32 [N, d] to `action` float32 [N, m].

    N is any number of observations. The parameters are in the model, not in a file beside it.

    Raises:
        ImportError: The extra is not installed.
        ValueError: A policy with an operation that cannot be converted.
    """
    check_extra()
    import onnx

    size = about["observation_size"]
    try:
        with _quiet():
            model = _converted(controller, size)
            # The newest would keep readers away that know all of the operations.
            model.ir_version = onnx.helper.find_min_ir_version_for(model.opset_import)
            onnx.checker.check_model(model, full_check=True)
    except Exception as error:  # a converter fails in many ways, each with a class of its own
        first = (str(error).strip().splitlines() or ["no message"])[0]
        raise ValueError(
            f"The controller cannot be converted to ONNX ({type(error).__name__}: {first}): "
            "export it with the format jax, or write its policy with other operations."
        ) from error
    named = {name: _text(value) for name, value in about.items() if value is not None}
    onnx.helper.set_model_props(model, named | {ABOUT: about["detpg"]})
    return model.SerializeToString()


def _converted(controller: Controller, size: int) -> Any:
    """The model; traced by JAX alone first.

    While jax2onnx traces it puts functions of its own in the place of `jax.numpy`'s, and under
    `jax.vmap` some of those are wrong (docs/decisions/0026).
    """
    import jax2onnx
    from jax.extend.core import jaxpr_as_fun

    alone = jax.ShapeDtypeStruct((size,), np.float32)
    plain = rewritten(deployed(controller), alone)
    many = jax.ShapeDtypeStruct(jax.export.symbolic_shape(f"N, {size}"), np.float32)
    batched = jaxpr_as_fun(jax.make_jaxpr(jax.vmap(lambda s: plain(s)[0]))(many))
    model = jax2onnx.to_onnx(
        lambda observation: batched(observation)[0],
        [many],
        model_name="controller",
        opset=OPSET,
        input_names=[INPUT],
        output_names=[OUTPUT],
    )
    # Shapes of intermediate results: nobody needs them, and not all are right.
    del model.graph.value_info[:]
    return model


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)


@contextmanager
def _quiet() -> Iterator[None]:
    """Without the converter's messages, and with the promotions that its own code relies on."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with (
            warnings.catch_warnings(),
            jax.numpy_dtype_promotion("standard"),
            jax.numpy_rank_promotion("allow"),
        ):
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)


def load_onnx(path: Path) -> Loaded:
    """A controller that was exported to ONNX, run by onnxruntime on the CPU.

    Raises:
        ImportError: The extra is not installed.
        ValueError: The file is no such controller.
    """
    check_extra()
    import onnxruntime

    try:
        options = onnxruntime.SessionOptions()
        options.log_severity_level = 3  # errors alone
        cpu = ["CPUExecutionProvider"]
        session = onnxruntime.InferenceSession(Path(path), options, providers=cpu)
        kept = session.get_modelmeta().custom_metadata_map
        about = {name: _value(name, text) for name, text in kept.items()}
        if not {"observation_size", ABOUT} <= about.keys():
            raise ValueError("a model of something else")
    except FileNotFoundError:
        raise
    except Exception as error:  # onnxruntime's own classes are not public
        raise ValueError(
            f"{path} is no controller that detpg exported to ONNX: give such a file."
        ) from error
    return Loaded(about, lambda seen: session.run([OUTPUT], {INPUT: seen})[0])


def _value(name: str, text: str) -> Any:
    return text if name in (ABOUT, "algorithm", "environment") else json.loads(text)


def has_onnx() -> bool:
    """Whether the extra's packages are installed."""
    return all(importlib.util.find_spec(name) is not None for name in NEEDED)


def check_extra() -> None:
    """Refuses, in one sentence, to go on without the extra's packages."""
    if not has_onnx():
        raise ImportError("ONNX export needs the extra: pip install 'detpg[onnx]'.")
