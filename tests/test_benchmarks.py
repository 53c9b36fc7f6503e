"""The benchmarks' table of contents, and that the baseline does the same work."""

import importlib
import sys

import jax
import numpy as np
import pytest
from benchmarks import __main__ as bench
from benchmarks import compatible

from detpg.policies import LinearPolicy, MLPPolicy


def test_every_id_is_measured_by_one_module():
    modules = [importlib.import_module(name) for name in bench.MODULES]
    ids = [name for module in modules for name in module.IDS]
    assert len(set(ids)) == len(ids) > 0
    for module in modules:
        assert callable(module.rows)
        last = module.__name__.rsplit(".", 1)[1]
        assert all(name.startswith(f"{last}.") for name in module.IDS)


def test_an_unknown_row_is_one_sentence(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setattr(sys, "argv", ["benchmarks", "figure9"])
    with pytest.raises(SystemExit) as ended:
        bench.main()
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith("bench: no row begins with 'figure9': choose from ")
    assert said.count("\n") == 1
    for name in (*compatible.IDS, "figure1.sweep.m10"):
        assert name in said


def test_a_prefix_chooses_rows(monkeypatch: pytest.MonkeyPatch, tmp_path):
    asked = []
    monkeypatch.setattr(sys, "argv", ["benchmarks", "compatible.double_m"])
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(compatible, "rows", lambda wanted: asked.append(wanted) or [])
    figure1 = importlib.import_module("benchmarks.figure1")
    monkeypatch.setattr(figure1, "rows", lambda wanted: asked.append(wanted) or [])
    bench.main()
    assert [name for wanted in asked for name in wanted] == ["compatible.double_m"]
    assert (tmp_path / "build" / "bench.json").exists()


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("policy", [LinearPolicy(3, 2), MLPPolicy(3, 2, hidden=(4,))])
def test_the_explicit_jacobian_makes_the_same_update(policy):
    learner, state, transition = jax.tree.map(
        lambda x: x.astype(float) if x.dtype.kind == "f" else x, compatible.example(policy)
    )
    # Steps large enough to be seen.
    steps = {"alpha_theta": 0.1, "alpha_w": 0.2, "alpha_v": 0.3}
    learner = type(learner)(policy, learner.state_value, learner.bounds, **steps)
    ours = compatible.products(learner, state, transition)
    theirs = compatible.jacobian(learner, state, transition)
    for a, b, before in zip(
        jax.tree.leaves(ours), jax.tree.leaves(theirs), jax.tree.leaves(state), strict=True
    ):
        np.testing.assert_allclose(a, b, rtol=1e-12)
        assert np.any(np.abs(a - before) > 1e-3)
