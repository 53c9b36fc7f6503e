"""Exported files answer as the training code does; what cannot be exported is refused."""

import dataclasses
import itertools
import json
import pickle

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.integrations.exported import SPEC, with_policy, wrapped

from detpg.algorithms import ALGORITHMS
from detpg.integrations.export import export, files, load_jax, load_json, load_onnx, parity
from detpg.integrations.export.parity import EPSILON, observations
from detpg.policies import LinearPolicy
from detpg.types import Bounds
from detpg.wrappers import Controller, Metered, Moments, Normalised

LOAD = {"onnx": load_onnx, "jax": load_jax, "json": load_json}
# Of each kind both with a normaliser, which cuts extreme observations off, and without.
PLAIN = ["tanh", "wrapped", "hashed"]
NORMALISED = ["tanh", "sigmoid", "quadratic", "tiles", "constant"]
BOTH = [*((name, False) for name in PLAIN), *((name, True) for name in NORMALISED)]


def exported(controller, tmp_path, kind, spec=SPEC):
    path = tmp_path / f"controller.{kind}"
    found = export(controller, 3, path, kind, spec)
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
    return found, LOAD[kind](path)


@pytest.mark.parametrize(
    ("name", "kind"),
    [*itertools.product(ALGORITHMS, ("onnx", "json")), ("offpac", "jax"), ("dac", "jax")],
)
def test_every_learner(name, kind, tmp_path):
    controller = wrapped(ALGORITHMS[name].create(SPEC))
    found, loaded = exported(controller, tmp_path, kind)
    assert found.equal
    assert found.difference < 1e-5
    assert loaded.about["algorithm"] == name
    one = loaded([0.1, -0.2, 3.0])
    np.testing.assert_array_equal(loaded([[0.1, -0.2, 3.0]])[0], one)


@pytest.mark.parametrize("kind", ["onnx", "json"])
@pytest.mark.parametrize(("name", "normalised"), BOTH)
def test_every_policy(name, kind, normalised, tmp_path):
    found, _ = exported(with_policy(name, normalised), tmp_path, kind)
    assert found.equal


@pytest.mark.parametrize("kind", ["onnx", "jax"])
def test_a_policy_of_ones_own(kind, tmp_path):
    found, _ = exported(with_policy("own"), tmp_path, kind)
    assert found.equal


@pytest.mark.parametrize("kind", LOAD)
def test_the_whole_pipeline_by_hand(kind, tmp_path):
    """(s - mean) / deviation, theta, the box, its scale; a component without an upper bound."""
    theta = np.asarray([[1.0, 0, 0], [0, -2, 0.5]], np.float32)
    bounds = Bounds((0.0, -1.0), (10.0, np.inf))
    learner = ALGORITHMS["copdac-q"].create(SPEC, policy=LinearPolicy(3, 2))
    learner = Normalised.create(SPEC, algorithm=learner)
    state = learner.init(jax.random.key(0))
    inner = dataclasses.replace(state.learner, theta=jnp.asarray(theta))
    seen = Moments.of(4, jnp.asarray([1.0, 2, 3]), jnp.asarray([1.0, 2, 3]))
    state = dataclasses.replace(state, learner=inner, observations=seen)
    metered = Metered(Normalised.create(SPEC, algorithm=learner.algorithm), bounds)
    meter = metered.init(jax.random.key(0))
    controller = Controller(metered, dataclasses.replace(meter, learner=state), bounds)
    _, loaded = exported(controller, tmp_path, kind)
    # Deviations are 1, 2, 3; what is normalised is cut off at 10.
    cases = {(1.5, 4, 3): (5 + 5 * 0.5, -1), (1, 0, 6): (5, 2 + 0.5), (9, -99, 3): (10, 20)}
    found = loaded(list(cases))
    np.testing.assert_allclose(found, list(cases.values()), rtol=1e-6)
    assert loaded.about["action_high"] == [10, None]


@pytest.mark.parametrize("unit", [1e-7, 1e7])
@pytest.mark.parametrize("kind", LOAD)
def test_observations_in_any_unit(kind, unit, tmp_path):
    controller = with_policy("linear", normalised=True)
    seen = Moments.of(9, unit * jnp.asarray([0.1, -3.0, 5.0]), unit * jnp.asarray([0.3, 3.0, 1.0]))
    state = dataclasses.replace(controller.learner, observations=seen)
    controller = dataclasses.replace(controller, learner=state)
    found, loaded = exported(controller, tmp_path, kind)
    assert found.equal
    near = unit * np.asarray([[0.1, -3.0, 5.0], [0.4, 0.0, 4.0]])
    assert np.abs(np.diff(loaded(near), axis=0)).max() > 0.01


def test_unbounded_actions(tmp_path):
    spec = dataclasses.replace(SPEC, action_low=(-np.inf,) * 2, action_high=(np.inf,) * 2)
    found, loaded = exported(with_policy("linear", spec=spec), tmp_path, "json", spec)
    assert found.equal
    assert np.abs(loaded([1e6, 1e6, 1e6])).max() > 1e3


def test_in_double_precision(tmp_path, x64):
    controller = with_policy("linear", normalised=True)
    assert controller.learner.learner.theta.dtype == float
    found, _ = exported(controller, tmp_path, "jax")
    assert found.equal


def test_the_onnx_model(tmp_path):
    import onnx

    exported(with_policy("tiles"), tmp_path, "onnx")
    model = onnx.load(tmp_path / "controller.onnx", load_external_data=False)
    onnx.checker.check_model(model, full_check=True)
    (seen,), (action,) = model.graph.input, model.graph.output
    assert (seen.name, action.name) == ("observation", "action")
    shapes = [
        [d.dim_param or d.dim_value for d in v.type.tensor_type.shape.dim] for v in (seen, action)
    ]
    assert shapes == [["N", 3], ["N", 2]]
    assert [(o.domain, o.version) for o in model.opset_import] == [("", 18)]
    assert model.ir_version == 8  # the least of opset 18; `exported` has run it in onnxruntime
    assert not any(onnx.external_data_helper.uses_external_data(t) for t in model.graph.initializer)
    told = {entry.key: entry.value for entry in model.metadata_props}
    assert told["environment"] == "world"
    assert told["algorithm"] == "copdac-q"
    assert json.loads(told["action_low"]) == [-2, -1]


def answers(controller):
    many = jax.jit(jax.vmap(lambda seen: controller(seen)))
    return lambda seen: np.asarray(many(seen))


def test_parity_sees_what_is_missing():
    controller = with_policy("linear", normalised=True)
    inner = Controller(controller.algorithm.algorithm, controller.learner.learner, SPEC.bounds)
    assert parity(controller, 3, answers(controller)).equal
    assert parity(controller, 3, answers(inner)).excess > 1e3


def test_parity_sees_a_difference_beyond_rounding():
    controller = with_policy("tanh")
    right = answers(controller)

    def shifted(by):
        return parity(controller, 3, lambda seen: right(seen) + np.float32(by))

    assert shifted(EPSILON / 2).equal
    assert not shifted(2e-5).equal
    assert shifted(2e-5).difference == pytest.approx(1e-5, rel=0.1)


def test_parity_sees_numbers_for_nan_and_single_observations():
    controller = with_policy("linear")
    right = answers(controller)
    assert parity(controller, 3, lambda seen: np.nan_to_num(right(seen))).excess == np.inf
    alone = parity(controller, 3, lambda seen: right(seen) + (len(seen) == 1))
    assert alone.difference == pytest.approx(0.5)


def test_parity_forgives_a_tile_that_rounding_explains():
    controller = with_policy("tiles")
    right = answers(controller)
    seen = observations(controller, 3, SPEC)
    near = parity(controller, 3, lambda seen: right(np.nextafter(seen, np.float32(0))), SPEC)
    far = parity(controller, 3, lambda seen: right(seen * np.float32(0.999)), SPEC)
    assert near.equal
    assert not far.equal
    assert near.num_observations > len(seen)


def test_a_file_that_answers_otherwise_is_not_put_in_place(tmp_path, monkeypatch):
    path = tmp_path / "controller.json"
    export(with_policy("linear"), 3, path, "json")
    before = path.read_bytes()
    convert, load = files.KINDS["json"]
    other = with_policy("tanh")
    wrong = {"json": (lambda controller, about: convert(other, about), load)}
    monkeypatch.setattr(files, "KINDS", wrong)
    with pytest.raises(ValueError, match=r"at the observation \(.*\) its action differs .* by"):
        export(with_policy("linear"), 3, path, "json")
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("kind", "name", "words"),
    [
        ("json", "own", "The policy Own is not one of the library's own"),
        ("onnx", "calling", "cannot be converted to ONNX"),
        ("jax", "calling", "JAX cannot export the controller"),
        ("pickle", "linear", "choose one of onnx, jax, json"),
    ],
)
def test_what_cannot_be_exported(kind, name, words, tmp_path):
    with pytest.raises(ValueError, match=words):
        export(with_policy(name), 3, tmp_path / "controller", kind)
    assert list(tmp_path.iterdir()) == []


def test_a_controller_that_diverged_or_has_another_size(tmp_path):
    controller = with_policy("linear")
    learner = dataclasses.replace(controller.learner, theta=jnp.full((2, 3), jnp.nan))
    diverged = Controller(controller.algorithm, learner, SPEC.bounds)
    with pytest.raises(ValueError, match=r"state\.theta is not finite"):
        export(diverged, 3, tmp_path / "controller.json", "json")
    with pytest.raises(ValueError, match="from an observation of size 4"):
        export(controller, 4, tmp_path / "controller.json", "json")


def test_without_the_extra(tmp_path, monkeypatch):
    found = files.to_onnx.__globals__["importlib"].util
    monkeypatch.setattr(found, "find_spec", lambda name: None)
    with pytest.raises(ImportError, match=r"needs the extra: pip install 'detpg\[onnx\]'\."):
        export(with_policy("linear"), 3, tmp_path / "controller.onnx", "onnx")


class Trap:
    def __reduce__(self):
        return pytest.fail, ("code in the file was executed",)


@pytest.mark.parametrize("kind", LOAD)
@pytest.mark.parametrize("content", [b"", b"{}\n", b"[1]", pickle.dumps(Trap()), b'{"format": 1}'])
def test_files_of_another_kind_are_refused(kind, content, tmp_path):
    path = tmp_path / "foreign"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="foreign is no controller that detpg exported"):
        LOAD[kind](path)


def test_a_damaged_program_is_refused(tmp_path):
    path = tmp_path / "controller.jax"
    export(with_policy("linear"), 3, path, "jax")
    whole = path.read_bytes()
    for damaged in (whole[:-9], whole[:-9] + bytes(9)):
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match="is damaged: export the controller again"):
            load_jax(path)


def test_an_observation_of_another_size_is_refused(tmp_path):
    _, loaded = exported(with_policy("linear"), tmp_path, "json")
    with pytest.raises(ValueError, match=r"shape \(2,\): give \(3,\), or \(N, 3\)"):
        loaded([1.0, 2.0])
