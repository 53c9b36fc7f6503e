"""What `--json` prints is JSON whatever a user's world prints, and however."""

import json
import os
import subprocess
import sys

import pytest

from detpg.cli import main
from detpg.cli.json_output import json_alone, print_json
from made_runs import FakeRun, write_run

LOUD = """
import atexit
import os
import sys

import gymnasium
import numpy as np

print("at import")
atexit.register(print, "at exit")
held = sys.stdout


class Loud(gymnasium.Env):
    observation_space = gymnasium.spaces.Box(-1.0, 1.0, (1,))
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,))

    def __init__(self):
        print("when made")

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        os.system("echo by a process")
        return self.np_random.uniform(-1, 1, 1).astype(np.float32), {}

    def step(self, action):
        os.write(1, b"by compiled code\\n")
        print("by a stream", file=held, flush=True)
        return np.clip(action, -1, 1).astype(np.float32), float(action[0]), False, False, {}

    def close(self):
        print("at last")


gymnasium.register("Loud-v0", Loud, max_episode_steps=5)
"""
SAID = ["at import", "when made", "by a process", "by compiled code", "by a stream", "at last"]


def test_a_world_that_prints(tmp_path):
    """As a process of its own, for only that ends."""
    (tmp_path / "loud.py").write_text(LOUD)
    call = [sys.executable, "-m", "detpg", "check-env", "loud:Loud-v0", "--steps", "8", "--json"]
    done = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert json.loads(done.stdout)["environment"] == "loud:Loud-v0"
    for words in (*SAID, "at exit"):
        assert words in done.stderr.splitlines()


@pytest.mark.parametrize("command", ["check-env", "evaluate", "list", "verify"])
def test_every_command_that_has_it(command, tmp_path, monkeypatch, capfd):
    """Called from Python, after which standard output is what it was."""
    write_run(tmp_path / "run")

    def loudly(found):
        def run(*_: object, **__: object):
            print("in Python")
            os.write(1, b"below it\n")
            return found

        return run

    run = FakeRun(tmp_path / "run", [[1.0, 2.0]])
    for name, found in (
        ("detpg.testing.check_gymnasium", []),
        ("detpg.workbench.open_run", run),
        ("detpg.cli.list_command.contents", {}),
        ("detpg.theorems.verify", {}),
    ):
        monkeypatch.setattr(name, loudly(found))
    words = {"check-env": ["Loud-v0"], "evaluate": [str(tmp_path / "run")]}.get(command, [])
    main([command, *words, "--json"])
    captured = capfd.readouterr()
    json.loads(captured.out)
    assert captured.err == "in Python\nbelow it\n"
    print("again")
    os.write(1, b"and below\n")
    assert sorted(capfd.readouterr().out.splitlines()) == ["again", "and below"]


def test_json_without_standard_output_or_error_harms_nothing(monkeypatch, capfd):
    monkeypatch.setattr(sys, "stdout", None)
    with json_alone(for_good=False):
        print_json({})
    monkeypatch.undo()
    kept = os.dup(2)
    try:
        os.close(2)
        with json_alone(for_good=False):
            os.write(1, b"nowhere\n")
            print_json({})
    finally:
        os.dup2(kept, 2)
        os.close(kept)
    assert capfd.readouterr().out == "{}\n"
