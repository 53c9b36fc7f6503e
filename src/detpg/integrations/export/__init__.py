"""A controller as one file, for a machine without the library: ONNX, JAX's own format, or JSON.

In: a `detpg.wrappers.Controller`. Out: a file that takes an observation in the world's units and
gives the action in them, normaliser, bounds and scaling included. Nothing is put in place before
what was written answers as the training code does.
"""

from detpg.integrations.export.describe import load_json
from detpg.integrations.export.files import export
from detpg.integrations.export.loaded import Loaded
from detpg.integrations.export.parity import Parity, parity
from detpg.integrations.export.to_jax import load_jax
from detpg.integrations.export.to_onnx import has_onnx, load_onnx

__all__ = ["Loaded", "Parity", "export", "has_onnx", "load_jax", "load_json", "load_onnx", "parity"]
