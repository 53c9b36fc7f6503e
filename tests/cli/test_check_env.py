"""`detpg check-env` through its entry point."""

import json
import sys
from pathlib import Path

import pytest

from detpg.cli import main
from detpg.environments import ENVIRONMENTS
from toys import Chain

OWN = '''
import gymnasium
import numpy as np


class Deaf(gymnasium.Env):
    """Ignores its action."""

    observation_space = gymnasium.spaces.Box(-1.0, 1.0, (1,))
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self.seen(), {}

    def step(self, action):
        return self.seen(), self.np_random.normal(), False, False, {}

    def seen(self):
        return self.np_random.uniform(-1, 1, 1).astype(np.float32)


gymnasium.register("Deaf-v0", Deaf)
'''


def levels(capsys: pytest.CaptureFixture[str]) -> dict[str, str]:
    found = json.loads(capsys.readouterr().out)["findings"]
    assert all(set(row) == {"level", "check", "found", "advice"} for row in found)
    return {row["check"]: row["level"] for row in found}


def test_a_gymnasium_id(capsys: pytest.CaptureFixture[str]):
    main(["check-env", "Pendulum-v1", "--steps", "400", "--json"])
    assert set(levels(capsys).values()) == {"fine"}
    main(["check-env", "Pendulum-v1", "--steps", "50"])
    said = capsys.readouterr().out
    for words in ("Pendulum-v1", "same seed", "0 problems, 0 warnings"):
        assert words in said


def test_a_problem_ends_with_code_1(
    tmp_path: Path, monkeypatch, capsys: pytest.CaptureFixture[str]
):
    """In a module of one's own, where the command is called; a warning alone ends with 0."""
    (tmp_path / "my_own_worlds.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path])
    words = ["check-env", "my_own_worlds:Deaf-v0", "--steps", "80", "--time-limit", "10"]
    with pytest.raises(SystemExit) as ended:
        main([*words, "--json"])
    assert ended.value.code == 1
    assert {check: level for check, level in levels(capsys).items() if level != "fine"} == {
        "action": "problem"
    }
    with pytest.raises(SystemExit):
        main(words)
    assert "1 problem, 0 warnings" in capsys.readouterr().out


def test_a_warning_is_no_failure(monkeypatch, capsys: pytest.CaptureFixture[str]):
    main(["check-env", "detpg/LQR-v0", "--steps", "10", "--json"])
    assert levels(capsys)["action bounds"] == "warning"
    monkeypatch.setenv("COLUMNS", "60")
    main(["check-env", "detpg/LQR-v0", "--steps", "10"])
    assert "…" not in capsys.readouterr().out  # what to do is told in whole words


def test_an_environment_of_this_library(monkeypatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setitem(ENVIRONMENTS, "mine", Chain)
    main(["check-env", "mine", "--json"])
    assert levels(capsys) == {"conformance": "fine"}
    monkeypatch.setitem(ENVIRONMENTS, "mine", dict)
    with pytest.raises(SystemExit) as ended:
        main(["check-env", "mine", "--json"])
    assert ended.value.code == 1
    assert levels(capsys) == {"conformance": "problem"}


def test_options_of_the_environment(capsys: pytest.CaptureFixture[str]):
    words = ["check-env", "detpg/LQR-v0", "--steps", "10", "--json", "--environment-option"]
    main([*words, "gamma=0.5"])
    assert levels(capsys)["action bounds"] == "warning"
    main(["check-env", "lqr", "--json", "--environment-option", "gamma=0.5"])
    assert levels(capsys) == {"conformance": "fine"}


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("Pendulm-v1",), ("'Pendulm-v1'", "Did you mean", "Pendulum")),
        (("nowhere_at_all:X-v0",), ("nowhere_at_all",)),
        (("Pendulum-v1", "--environment-option", "mass=1"), ("cannot be built", "'mass'")),
        (("pendulum", "--environment-option", "mass=1"), ("cannot be built", "'mass'")),
        (("Pendulum-v1", "--environment-option", "g"), ("--environment-option g", "NAME=VALUE")),
        (("Pendulum-v1", "--steps", "0"), ("--steps 0", "give 1")),
        (("Pendulum-v1", "--seed", "-1"), ("--seed -1", "2147483647")),
        (("Pendulum-v1", "--time-limit", "0"), ("--time-limit 0", "give 1")),
    ],
)
def test_bad_input_is_one_sentence(words, named, capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit) as ended:
        main(["check-env", *words])
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith("detpg: ")
    assert said.count("\n") == 1
    for word in named:
        assert word in said
