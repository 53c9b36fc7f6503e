"""Exported files on a machine that has neither the library nor, but for its own format, JAX."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.integrations.exported import SPEC, with_policy

import detpg.workbench
from detpg.cli import main
from detpg.integrations.export import export, load_json, reader
from made_runs import write_run

ROOT = Path(__file__).parents[2]
SEEN = [0.3, -0.2, 4.5]
# A machine without some packages: to import one of them fails as if it was not there.
WITHOUT = """
import runpy, sys
for name in sys.argv.pop(1).split(","):
    sys.modules[name] = None
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


def ran(script: Path, *words: object, without: str = "jax,detpg") -> np.ndarray:
    """The numbers that a script prints."""
    call = [sys.executable, "-P", "-c", WITHOUT, without, script, *words]
    plain = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        [str(word) for word in call], capture_output=True, text=True, env=plain, check=False
    )
    assert done.returncode == 0, done.stderr
    return np.asarray(done.stdout.split(), float)


def by_json(controller, tmp_path):
    path = tmp_path / "reference.json"
    export(controller, 3, path, "json")
    return load_json(path)(SEEN)


def test_onnx_in_fifteen_lines(tmp_path):
    controller = with_policy("tiles", normalised=True)
    export(controller, 3, tmp_path / "controller.onnx", "onnx")
    script = ROOT / "examples/run_onnx.py"
    assert len(script.read_text().splitlines()) <= 16
    found = ran(script, tmp_path / "controller.onnx", *SEEN)
    np.testing.assert_allclose(found, by_json(controller, tmp_path), rtol=1e-5)


@pytest.mark.parametrize("name", ["tanh", "hashed", "quadratic"])
def test_json_with_numpy_alone(name, tmp_path):
    controller = with_policy(name, normalised=True)
    export(controller, 3, tmp_path / "controller.json", "json")
    shutil.copy(reader.__file__, tmp_path / "reader.py")
    script = tmp_path / "run.py"
    script.write_text(
        "import sys\nsys.path.insert(0, sys.argv[1])\nimport reader\n"
        "run = reader.load(sys.argv[2])\nprint(*run([[float(x) for x in sys.argv[3:]]])[0])\n"
    )
    found = ran(script, tmp_path, tmp_path / "controller.json", *SEEN)
    np.testing.assert_allclose(found, by_json(controller, tmp_path), rtol=1e-5)


def test_jax_alone_as_the_page_says(tmp_path):
    controller = with_policy("sigmoid")
    export(controller, 3, tmp_path / "controller.jax", "jax")
    page = (ROOT / "docs/export.md").read_text()
    (code,) = (c for c in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "partition" in c)
    script = tmp_path / "run.py"
    given = f"observations = np.asarray([{SEEN}], np.float32)"
    code = code.replace("controller.jax", str(tmp_path / "controller.jax"))
    changed = re.sub(r"observations = .*", given, code)
    assert given in changed
    script.write_text(changed + "\nprint(*actions[0])\n")
    found = ran(script, without="detpg")
    np.testing.assert_allclose(found, by_json(controller, tmp_path), rtol=1e-5)


class FakeRun:
    """What the command asks of a run."""

    spec = SPEC

    def __init__(self, path, own):
        """In the place of `open_run`."""

    def controller(self, which, index):
        return with_policy({"best": "tanh", "last": "own"}[which], normalised=index == 1)


def test_the_command(tmp_path, monkeypatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setattr(detpg.workbench, "open_run", FakeRun, raising=False)
    monkeypatch.chdir(tmp_path)
    write_run(tmp_path / "run")
    main(["export", "run", "--format", "json", "--index", "1"])
    said = capsys.readouterr().out
    assert said.startswith("written to controller.json: ")
    about = load_json(tmp_path / "controller.json").about
    assert about["environment"] == "world"
    for words, sentence in (
        (["export", "nothing", "--format", "json"], "nothing is not a run: name"),
        (
            ["export", "run", "--format", "json", "--policy", "last"],
            "Own is not one of the library",
        ),
        (
            ["export", "run", "--format", "json", "--output", "no/where.json"],
            "cannot be written to",
        ),
    ):
        with pytest.raises(SystemExit) as stop:
            main(words)
        assert stop.value.code == 2
        assert sentence in capsys.readouterr().err
