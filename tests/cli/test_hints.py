"""Every command that is named to a user works as it is typed."""

import shlex
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from detpg.cli import hints, main, train
from detpg.cli.evaluate import Evaluate
from detpg.integrations.logged import write
from detpg.types import Bounds
from detpg.workbench import Config

OWN_WORLD = """
import gymnasium
import numpy as np


class Hill(gymnasium.Env):
    observation_space = gymnasium.spaces.Box(-1.0, 1.0, (2,))
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros(2, np.float32), {}

    def step(self, action):
        return np.zeros(2, np.float32), -float(action[0] ** 2), False, False, {}


gymnasium.register("Hill-v0", Hill, max_episode_steps=4)
"""
OWN_POLICY = """
import jax.numpy as jnp
from detpg.policies import FunctionPolicy

hill = FunctionPolicy(lambda theta, s: theta @ s, jnp.ones((1, 2)))
"""
SMALL = ("--steps", "20", "--log-every", "10", "--evaluate-every", "10", "--checkpoint-every", "10")
SMALL += ("--evaluation-episodes", "2", "--value", "quadratic", "--normalise", "none")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Where the commands are called: its names have spaces and what a shell takes for its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "hills.py").write_text(OWN_WORLD)
    (tmp_path / "my policies").mkdir()
    (tmp_path / "my policies" / "it's.py").write_text(OWN_POLICY)
    yield tmp_path
    gymnasium.registry.pop("Hill-v0", None)
    sys.modules.pop("hills", None)


def said(capsys, *words: str) -> list[str]:
    main(words)
    return capsys.readouterr().out.splitlines()


def named(lines: list[str]) -> dict[str, list[str]]:
    """Command -> its words, of the lines that name one."""
    found = [shlex.split(line[line.index("detpg ") :]) for line in lines if "detpg " in line]
    return {words[1]: words[1:] for words in found}


def test_what_is_one_s_own_is_named_again(capsys, monkeypatch):
    """First as it is stopped, then as it ends; in a new process nothing of it is imported."""
    flags = ("--policy", "my policies/it's.py:hill", "--output", "my runs/$1")
    with monkeypatch.context() as patch:
        patch.setattr(train._Stop, "asked", lambda stop: True)
        with pytest.raises(SystemExit) as ended:
            main(["train", "opdac", "hills:Hill-v0", *SMALL, *flags])
    assert ended.value.code == 130
    (stopped,) = capsys.readouterr().out.splitlines()
    assert stopped == (
        "stopped at step 10; continue with: detpg resume 'my runs/$1' --own-policy "
        """'my policies/it'"'"'s.py:hill' --own-environment hills:Hill-v0"""
    )
    sys.modules.pop("hills")
    gymnasium.registry.pop("Hill-v0")
    first, *lines = said(capsys, *named([stopped])["resume"])
    assert first == "done: 20 steps in my runs/$1"
    assert [line.split()[0] for line in lines] == ["look", "judge", "use"]
    after = named(lines)
    sys.modules.pop("hills")
    gymnasium.registry.pop("Hill-v0")
    assert said(capsys, *after["plot"]) == ["written to return.png and return.csv"]
    assert "opdac in hills:Hill-v0, its best policy, without noise" in said(
        capsys, *after["evaluate"]
    )
    assert said(capsys, *after["export"])[0].startswith("written to controller.onnx: ")


@pytest.mark.filterwarnings("ignore:log.parquet says that actions lie between")
@pytest.mark.parametrize("world", [(), ("lqr",)])
def test_after_logged_data_what_there_is_can_be_looked_at(world, capsys):
    """Without a world nothing can be judged; the one that is written as ours needs no flag."""
    seen = np.linspace(-1, 1, 80, dtype=np.float32).reshape(40, 2)
    action, over = seen[:, :1], np.arange(40) % 10 == 9
    rows = {"observation": seen, "action": action, "reward": seen[:, 0], "truncated": over}
    rows["bounds"] = Bounds((-1.0,), (1.0,))
    write("log.parquet", **rows, terminated=np.zeros(40, bool))
    flags = ("--data", "log.parquet", "--policy", "linear", "--output=-run")
    first, *lines = said(capsys, "train", "opdac", *world, *flags, *SMALL)
    assert first == "done: 20 steps in -run"
    after = named(lines)
    assert list(after) == ["plot", *(["evaluate"] if world else []), "export"]
    drawn = "return" if world else "td_error"
    assert said(capsys, *after["plot"]) == [f"written to {drawn}.png and {drawn}.csv"]
    assert said(capsys, *after["export"])[0].startswith("written to controller.onnx: ")
    if world:
        assert said(capsys, *after["evaluate"])
        return
    for command, words in (
        ("plot", "has logged data alone and no return: plot what training measured, such as "),
        ("evaluate", "was trained on logged data alone, and there is no world to play in: train "),
    ):
        with pytest.raises(SystemExit):
            main([command, "./-run"])
        assert f"detpg: -run {words}" in capsys.readouterr().err


def test_only_formats_that_are_installed_are_named(monkeypatch):
    config = Config("opdac", "lqr", policy="linear")
    monkeypatch.setattr("detpg.integrations.export.has_onnx", lambda: False)
    assert hints.after(Path("run"), config, None)["use"] == "detpg export run --format jax"


def test_an_environment_that_a_file_names_is_typed_again(capsys):
    Path("settings.toml").write_text('environment = "hills:Hill-v0"')
    with pytest.raises(SystemExit) as ended:
        main(["train", "opdac", "--config", "settings.toml"])
    assert ended.value.code == 2
    assert capsys.readouterr().err == (
        "detpg: settings.toml names an environment of your own, hills:Hill-v0: name it again, "
        "detpg train opdac hills:Hill-v0 ...; code is never loaded because a file says so.\n"
    )
    assert "hills" not in sys.modules


@pytest.mark.parametrize("goes_on", [True, False])
def test_only_what_goes_on_is_said_to_go_on(goes_on, capsys, monkeypatch):
    def interrupted(command: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(train.Resume, "run", interrupted)
    monkeypatch.setattr(Evaluate, "run", interrupted)
    with pytest.raises(SystemExit) as ended:
        main(["resume" if goes_on else "evaluate", "runs"])
    assert ended.value.code == 130
    again = "; run the same command again to continue" if goes_on else ""
    assert capsys.readouterr().err == f"detpg: stopped{again}.\n"
