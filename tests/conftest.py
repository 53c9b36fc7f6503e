"""How all tests run: types and shapes checked, promotions strict, XLA without its own threads."""

import importlib.metadata
import os
from pathlib import Path

# Set in the environment, so that worker processes and commands that tests start do the same. XLA's
# thread pool can wait for ever on a batched program where there are two cores. Nearly all of the
# time would go into compiling: code that is fast is not needed, and no program is compiled twice.
# XLA's older emitters, where it still has them, take a third of the newer ones' time for it
# (docs/decisions/0040).
os.environ["XLA_FLAGS"] = (
    f"{os.environ.get('XLA_FLAGS', '')} --xla_cpu_multi_thread_eigen=false"
).strip()
if importlib.metadata.version("jaxlib").startswith(("0.8.", "0.9.", "0.10.")):
    os.environ["XLA_FLAGS"] += " --xla_cpu_use_fusion_emitters=false"
os.environ.setdefault("JAX_DISABLE_MOST_OPTIMIZATIONS", "1")
os.environ.setdefault(
    "JAX_COMPILATION_CACHE_DIR", str(Path(__file__).parents[1] / "build" / "test-cache" / "jax")
)
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")

from collections.abc import Iterator

import hypothesis
import jax
import jaxtyping
import pytest

CORE = "types checks trees polynomials environments policies features critics actors"
CORE += " algorithms training wrappers replaying evaluation diagnostics theorems"
jaxtyping.install_import_hook([f"detpg.{name}" for name in CORE.split()], "beartype.beartype")

jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")

# The first example of a property compiles: no deadline. Derandomised: the same examples every time.
hypothesis.settings.register_profile(
    "detpg", derandomize=True, max_examples=10, deadline=None, database=None
)
hypothesis.settings.load_profile("detpg")


@pytest.fixture
def x64() -> Iterator[None]:
    """Double precision, for comparison with an oracle."""
    with jax.enable_x64(True):
        yield


@pytest.fixture
def unchecked() -> Iterator[None]:
    """As users run it, without type checks: what our own validation says must be seen."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)
