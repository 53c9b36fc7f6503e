"""Every script in `examples/` runs, and learns: with a smaller budget than its own."""

import importlib.util
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
STEPS = {
    "equinox_network": 10_000,
    "flax_network": 10_000,
    "lqr_gain": 20_000,
    "pid_pendulum": 20_000,
    "saturating_tracker": 20_000,
}
SEEDS = 4


def script(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / "examples" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_all_are_run():
    there = {path.stem for path in (ROOT / "examples").glob("*.py")}
    assert there == {*STEPS, "run_onnx"}  # the last is run where a controller is exported


@pytest.mark.slow
@pytest.mark.parametrize("name", STEPS)
def test_it_learns_on_every_seed(name, capsys):
    example = script(name)
    before, after = example.main(steps=STEPS[name], seeds=SEEDS)
    gained = np.asarray(after - before)
    error = np.std(gained, ddof=1) / np.sqrt(SEEDS)
    assert np.all(gained > 0), gained
    assert np.mean(gained) > 4.5 * error, (gained, error)
    said = capsys.readouterr().out
    assert "return before: " in said
    assert "return after: " in said
    if name == "lqr_gain":
        best = float(example.WORLD.objective(jnp.asarray(example.riccati(), dtype=float)))
        # nine tenths of what there is to gain, on every seed
        assert np.all(after > best - 0.1 * (best - before)), (after, best)
