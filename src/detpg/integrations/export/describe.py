"""JSON: the parameters and the structure of the library's own policies, for people to read."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import PyTree

from detpg.features.quadratic import QuadraticFeatures
from detpg.features.tile_coding import MARGIN, TileCoding
from detpg.integrations.export import reader
from detpg.integrations.export.loaded import Loaded
from detpg.integrations.export.parts import mean_policy, parts_of
from detpg.policies import ConstantPolicy, FeaturePolicy, LinearPolicy, MLPPolicy, NetworkPolicy
from detpg.types import Bounds
from detpg.wrappers import Controller

FORMAT = "detpg controller, JSON 1"


def to_json(controller: Controller, about: dict[str, Any]) -> bytes:
    """The controller as JSON: `reader.py` says what the entries mean, in NumPy.

    Raises:
        ValueError: A policy or features that are the user's own.
    """
    parts, bounds = parts_of(controller), controller.bounds
    mu, theta = mean_policy(parts)
    normaliser = parts.normaliser
    content = {
        "format": FORMAT,
        **about,
        "normaliser": None
        if normaliser is None
        else {
            "mean": _numbers(normaliser.mean),
            "deviation": _numbers(normaliser.deviation),
            "most": normaliser.most,
        },
        "policy": _known(POLICIES, mu, "policy")(mu, theta),
        "scaling": {
            "centre": _numbers(bounds.centre),
            "half_range": _numbers(bounds.half_range),
            "policy_bounds": _box(bounds.scaled),
            "action_bounds": _box(bounds),
        },
    }
    text = json.dumps(content, indent=2, allow_nan=False)
    # A row of numbers stays on its line.
    rows = re.sub(r"\[[^\[\]{}]*\]", lambda found: re.sub(r"\s+", " ", found[0]), text)
    return (rows.replace("[ ", "[").replace(" ]", "]") + "\n").encode()


def load_json(path: Path) -> Loaded:
    """A controller that was exported as JSON, run by NumPy.

    Raises:
        ValueError: The file is no such controller.
    """
    refusal = f"{path} is no controller that detpg exported as JSON: give such a file."
    try:
        kept = json.loads(Path(path).read_bytes())
        if kept["format"] != FORMAT:
            raise ValueError(refusal)
        run = reader.load(path)
    except (ValueError, TypeError, KeyError) as error:
        raise ValueError(refusal) from error
    own = ("format", "normaliser", "policy", "scaling")
    return Loaded({name: value for name, value in kept.items() if name not in own}, run)


def _known(table: dict[type, Callable], part: Any, words: str) -> Callable:
    if type(part) not in table:
        raise ValueError(
            f"The {words} {type(part).__name__} is not one of the library's own, which are all "
            "that JSON can describe: export the controller with the format onnx or jax."
        )
    return table[type(part)]


def _mlp(mu: MLPPolicy, theta: PyTree) -> dict[str, Any]:
    units = (*(mu.activation for _ in mu.hidden), mu.output)
    layers = [
        {"unit": unit} | {name: _numbers(values) for name, values in layer.items()}
        for unit, layer in zip(units, theta)
    ]
    return {"kind": "mlp", "layers": layers}


def _network(mu: NetworkPolicy, theta: PyTree) -> dict[str, Any]:
    if mu.norm != "none":
        raise ValueError(
            "JSON cannot describe a policy with LayerNorm: export it with the format onnx or jax."
        )
    return _mlp(MLPPolicy(1, 1, mu.hidden, "relu", mu.output), theta)


def _on_features(mu: FeaturePolicy, theta: PyTree) -> dict[str, Any]:
    x = mu.features
    described = _known(FEATURES, x, "feature map")(x)
    return {"kind": "features", "features": described, "theta": _numbers(theta)}


def _tiles(x: TileCoding) -> dict[str, Any]:
    return {
        "kind": "tiles",
        "grid": list(x.grid),
        "starts": _numbers(x.starts),
        "density": _numbers(x.density),
        "wrapped": [k in x.wrapped for k in range(len(x.grid))],
        "margin": MARGIN,
        "memory": x.memory,
        "bias": x.bias,
        "size": x.size,
    }


POLICIES: dict[type, Callable] = {
    ConstantPolicy: lambda mu, theta: {"kind": "constant", "theta": _numbers(theta)},
    LinearPolicy: lambda mu, theta: {"kind": "linear", "theta": _numbers(theta)},
    FeaturePolicy: _on_features,
    MLPPolicy: _mlp,
    NetworkPolicy: _network,
}
FEATURES: dict[type, Callable] = {
    QuadraticFeatures: lambda x: {"kind": "quadratic"},
    TileCoding: _tiles,
}


def _numbers(values: Any) -> Any:
    """Nested lists, each number with the fewest digits that give the same float32."""
    values = np.asarray(values, np.float32)
    return [_numbers(row) for row in values] if values.ndim else float(str(values))


def _box(bounds: Bounds) -> dict[str, Any]:
    pairs = zip(("low", "high"), bounds)
    return {name: [x if np.isfinite(x) else None for x in _numbers(ends)] for name, ends in pairs}
