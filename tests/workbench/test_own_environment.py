"""A run whose environment a module registers: the module is imported for what was typed alone."""

import sys

import pytest

from detpg.cli import main

MODULE = """
import os
import gymnasium
from gymnasium.envs.classic_control.pendulum import PendulumEnv

os.mkdir("imported")
if "Swing-v0" not in gymnasium.registry:
    gymnasium.register("Swing-v0", PendulumEnv, max_episode_steps=20)
"""


@pytest.fixture
def own(tmp_path, monkeypatch, unchecked):
    """A folder with such a module, as the command line finds it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    (tmp_path / "swinging.py").write_text(MODULE)
    yield tmp_path
    sys.modules.pop("swinging", None)


def test_a_run_does_not_import_what_it_names(own, capsys):
    words = ["train", "opdac", "swinging:Swing-v0", "--steps", "20", "--log-every", "20"]
    every = ["--evaluate-every", "20", "--checkpoint-every", "20", "--evaluation-episodes", "1"]
    main([*words, *every, "--output", "run"])
    assert (own / "imported").exists()
    (own / "imported").rmdir()
    for command in (["evaluate", "run"], ["resume", "run", "--steps", "40"]):
        del sys.modules["swinging"]
        with pytest.raises(SystemExit) as ended:
            main(command)
        assert ended.value.code == 2
        said = capsys.readouterr().err
        again = "name it again with --own-environment swinging:Swing-v0, or in Python import"
        assert f"{again} swinging first." in said
        assert not (own / "imported").exists()
        main([*command, "--own-environment", "swinging:Swing-v0"])
        assert (own / "imported").exists()
        (own / "imported").rmdir()
