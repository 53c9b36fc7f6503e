"""The folder of a run: whose it is, and what is left in it by a run that could not be."""

import json

import pytest

from detpg.runs import RunDirectoryError
from detpg.types import Bounds, EnvironmentSpec
from detpg.workbench import Config
from detpg.workbench.folder import found_config, opened, spec_json
from detpg.workbench.opened import read_spec

SPEC = EnvironmentSpec("toy", 2, 1, (-1.0,), (1.0,), 100, 0.9, (-2.0, 0.0), (2.0, float("inf")))
BOX = Bounds((-1.0,), (3.0,))


def entered(path, **changes):
    return opened(path, Config(**{"algorithm": "opdac", "environment": "toy"} | changes), SPEC, BOX)


def test_it_is_entered_again_by_the_same_run_alone(tmp_path):
    with entered(tmp_path / "run"), pytest.raises(RunDirectoryError, match=r"is in use by another"):
        entered(tmp_path / "run").__enter__()
    with entered(tmp_path / "run", steps=7):
        pass
    assert found_config(tmp_path / "run")["run"]["steps"] == 7
    with pytest.raises(RunDirectoryError, match=r"another run \(different: seeds, seed\): choose"):
        entered(tmp_path / "run", seed=1, seeds=2).__enter__()


def test_the_spec_comes_back(tmp_path):
    found = json.loads(json.dumps(spec_json(SPEC, BOX)))
    assert read_spec(found) == (SPEC, BOX)


def fail(path, error, meanwhile=lambda path: None):
    def run():
        with entered(path):
            meanwhile(path)
            raise error

    with pytest.raises(type(error)):
        run()


def test_a_run_that_cannot_be_leaves_nothing(tmp_path):
    fail(tmp_path / "a" / "b" / "run", ValueError("no"))
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / ".notes").write_text("mine")
    fail(tmp_path / "kept", ValueError("no"))
    assert [path.name for path in tmp_path.rglob("*")] == ["kept", ".notes"]


def test_what_others_made_meanwhile_is_kept(tmp_path):
    fail(tmp_path / "a" / "run", ValueError("no"), lambda path: (path / "../new").mkdir())
    assert [path.name for path in tmp_path.rglob("*")] == ["a", "new"]


def test_a_run_that_was_there_is_kept(tmp_path):
    with entered(tmp_path / "run"):
        pass
    fail(tmp_path / "run", ValueError("no"))
    fail(tmp_path / "stopped", KeyboardInterrupt())

    def checkpointed(path):
        (path / "checkpoints").mkdir()
        (path / "checkpoints" / "000000000040.json").write_text("{}")

    fail(tmp_path / "late", ValueError("no"), checkpointed)
    for name in ("run", "stopped", "late"):
        assert found_config(tmp_path / name) is not None


@pytest.mark.parametrize("run", [{}, {"algorithm": "opdac", "speed": 1}, {"algorithm": 3}])
def test_a_damaged_configuration_is_told(tmp_path, run):
    content = {"detpg": "0", "run": run, "spec": {}}
    (tmp_path / "config.json").write_text(json.dumps(content))
    with pytest.raises(RunDirectoryError, match=r"config\.json is damaged"):
        entered(tmp_path).__enter__()
