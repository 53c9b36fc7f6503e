"""`detpg train` and `detpg resume` through their entry point: signals, files, refusals."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from detpg.cli import main, train

OWN = '''
from __future__ import annotations

import dataclasses

import jax.numpy as jnp


@dataclasses.dataclass(frozen=True)
class Gains:
    """Three gains around a torque."""

    start: float = 0.0

    def init(self, key):
        return jnp.full(3, self.start)

    def __call__(self, theta, observation):
        return jnp.tanh(theta @ observation)[None]


def gains(spec):
    assert (spec.observation_size, spec.action_low) == (3, (-1.0,))
    return Gains(0.25)
'''
SETTINGS = """
steps = 40
seeds = 3
evaluation_episodes = 1
log_every = 200
evaluate_every = 200
checkpoint_every = 200
value = "quadratic"
[copdac-q]
sigma = 0.125
alpha_w = 0.03125
"""
WORDS = ("--policy", "own.py:gains", "--config", "settings.toml", "--output", "runs/mine")
FLAGS = ("--steps", "100000000", "--seeds", "2", "--sigma", "0.5")


def started(folder: Path, *words: str) -> subprocess.Popen[str]:
    quick = os.environ | {"JAX_DISABLE_MOST_OPTIMIZATIONS": "1", "COLUMNS": "200"}
    return subprocess.Popen(
        [sys.executable, "-m", "detpg", *words],
        cwd=folder,
        env=quick,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """A run that was stopped by Ctrl-C after its first checkpoint, and what it said."""
    folder = tmp_path_factory.mktemp("cli")
    (folder / "own.py").write_text(OWN)
    (folder / "settings.toml").write_text(SETTINGS)
    process = started(folder, "train", "copdac-q", "Pendulum-v1", *WORDS, *FLAGS)
    deadline = time.monotonic() + 300
    while not list((folder / "runs" / "mine" / "checkpoints").glob("*.json")):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    said, errors = process.communicate(timeout=200)
    return folder, process.returncode, said, errors


def test_ctrl_c_stops_after_the_interval_with_a_checkpoint(stopped):
    folder, code, said, errors = stopped
    assert code == 130, errors
    run = folder / "runs" / "mine"
    step = max(int(path.stem) for path in (run / "checkpoints").glob("*.json"))
    assert step % 200 == 0
    assert said.splitlines()[-1] == (
        f"stopped at step {step:,}; continue with: detpg resume runs/mine --own-policy own.py:gains"
    )
    rows = pq.read_table(run / "metrics.parquet").to_pylist()
    assert {row["step"] for row in rows} == set(range(200, step + 1, 200))
    assert {row["seed"] for row in rows} == {0, 1}
    assert "copdac-q in Pendulum-v1, into runs/mine" in errors
    assert "Traceback" not in errors


def test_flags_go_before_the_file_and_the_file_before_the_defaults(stopped):
    found = json.loads((stopped[0] / "runs" / "mine" / "config.json").read_text())["run"]
    assert (found["steps"], found["seeds"]) == (100_000_000, 2)  # flags
    assert found["options"] == {"sigma": 0.5, "alpha_w": 0.03125}  # a flag, the file
    assert (found["log_every"], found["value"]) == (200, "quadratic")  # the file
    assert found["normalise"] == "observations"  # the default
    assert found["policy"] == "own.py:gains"


def test_it_is_continued_with_the_policy_named_again(stopped, capsys, monkeypatch):
    folder = stopped[0]
    monkeypatch.chdir(folder)
    assert refusal(capsys, "resume", "runs/mine") == (
        "runs/mine was trained with a policy of your own, own.py:gains: name it again with "
        "--own-policy; code is never loaded from a run."
    )
    run = folder / "runs" / "mine"
    steps = max(int(path.stem) for path in (run / "checkpoints").glob("*.json")) + 200
    before = np.load(run / "last.npz")["leaf0"]
    assert before.shape == (2, 3)
    assert np.all(before != 0.25)
    words = ("resume", "runs/mine", "--own-policy", "own.py:gains", "--steps", str(steps))
    process = started(folder, *words)
    said, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors
    assert said.splitlines()[0] == f"done: {steps:,} steps in runs/mine"
    assert "a resumed run goes on with a new episode" in errors
    assert len(pq.read_table(run / "metrics.parquet")) == 2 * steps // 200
    assert np.any(np.load(run / "last.npz")["leaf0"] != before)


def test_the_second_ctrl_c_stops_at_once(capsys, monkeypatch):
    def run(self):
        stop = train._Stop()
        with stop.listening():
            os.kill(os.getpid(), signal.SIGINT)
            assert stop.asked()
            os.kill(os.getpid(), signal.SIGINT)
            pytest.fail("it went on")

    monkeypatch.setattr(train.Resume, "run", run)
    with pytest.raises(SystemExit) as ended:
        main(["resume", "runs"])
    assert ended.value.code == 130
    words = "detpg: stopped; run the same command again to continue.\n"
    assert capsys.readouterr().err == words


def refusal(capsys, *words: str) -> str:
    """What is said of words that cannot be used: one sentence on one line, exit code 2."""
    with pytest.raises(SystemExit) as ended:
        main(words)
    captured = capsys.readouterr()
    assert ended.value.code == 2
    assert captured.out == ""
    (line,) = captured.err.splitlines()
    assert line.startswith("detpg: ")
    assert line.endswith(".")
    return line.removeprefix("detpg: ")


TRAIN = ("train", "copdac-q")
REFUSED = [
    ((*TRAIN,), "There is nothing to learn from: name an environment, or give data."),
    ((*TRAIN, "Nowhere-v0"), "environment 'Nowhere-v0' cannot be built: "),
    ((*TRAIN, "CartPole-v1"), "The action space Discrete(2) cannot be used, "),
    ((*TRAIN, "lqr", "--steps", "0"), "steps = 0 is not usable: give 1 or more."),
    ((*TRAIN, "lqr", "--sigma", "-1"), "sigma = -1 is not usable: give a finite number between "),
    ((*TRAIN, "lqr", "--num-envs", "2"), "num_envs = 2 is not usable with 'lqr', "),
    ((*TRAIN, "lqr", "--policy", "deep"), "policy 'deep' is unknown: choose one of "),
    ((*TRAIN, "lqr", "--policy", "none.py:x"), "policy 'none.py:x' cannot be loaded: there is no"),
    ((*TRAIN, "lqr", "--policy", "own.py:y"), "policy 'own.py:y' cannot be loaded: own.py has no"),
    ((*TRAIN, "lqr", "--policy", "bad.py:x"), "policy 'bad.py:x' cannot be loaded: ZeroDivisionE"),
    ((*TRAIN, "lqr", "--policy", "own.py:Three"), "own.py:Three is no policy: give an object"),
    ((*TRAIN, "lqr", "--config", "none.toml"), "none.toml cannot be read (No such file or direct"),
    ((*TRAIN, "lqr", "--config", "odd.toml"), "'learning_rate' is no setting of a run: leave it"),
    ((*TRAIN, "lqr", "--config", "text.toml"), "steps = 'many' is no whole number: give one, suc"),
    ((*TRAIN, "lqr", "--config", "run.toml"), "run.toml holds no settings: give "),
    (
        (*TRAIN, "lqr", "--config", "whose.toml"),
        "whose.toml names a policy of your own, bad.py:x: name it again with --policy; code is "
        "never loaded because a file says so.",
    ),
    ((*TRAIN, "lqr", "--config", "tuned"), "--config tuned knows nothing for copdac-q in lqr, on"),
    ((*TRAIN, "lqr", "--environment-option", "m"), "--environment-option m cannot be used: give "),
    ((*TRAIN, "lqr", "--environment-option", "zeta=1"), "lqr cannot be built with {'zeta': 1}: "),
    ((*TRAIN, "--data", "none.parquet"), "none.parquet"),
    (("train", "bandit-copdac", "lqr"), "The learner takes batches of "),
    (("resume", "runs"), "runs is no run of `detpg train`: name its folder."),
]


@pytest.mark.parametrize(("words", "said"), REFUSED)
def test_what_cannot_be_used_is_refused_and_leaves_nothing(
    words, said, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    files = {
        "own.py": "def Three(spec):\n    return 3\n",
        "bad.py": "1 / 0\n",
        "odd.toml": "learning_rate = 0.1\n",
        "text.toml": 'steps = "many"\n',
        "run.toml": "run = 3\n",
        "whose.toml": 'policy = "bad.py:x"\n',
    }
    for name, content in files.items():
        Path(name).write_text(content)
    assert said in refusal(capsys, *words)
    assert {path.name for path in tmp_path.iterdir() if path.name != "__pycache__"} == set(files)


@pytest.mark.parametrize("folder", ["runs/new", "empty", "kept"])
def test_what_fails_at_its_first_episode_leaves_nothing(folder, tmp_path, capsys, monkeypatch):
    """The world's episodes do not end, which only playing it can show."""
    from detpg.workbench import judged

    monkeypatch.setattr(judged, "LONGEST", 20)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "workbench")
    import gymnasium
    from slope import Endless

    if "Endless-v0" not in gymnasium.registry:
        gymnasium.register("Endless-v0", Endless)
    Path("empty").mkdir()
    Path("kept").mkdir()
    Path("kept/.notes").write_text("mine")
    before = sorted(tmp_path.rglob("*"))
    flags = ("--policy", "linear", "--value", "quadratic", "--output", folder)
    with pytest.raises(SystemExit) as ended:
        main([*TRAIN, "Endless-v0", *flags])
    assert ended.value.code == 2
    assert capsys.readouterr().err.splitlines()[-1] == (
        "detpg: An episode of 'Endless-v0' did not end in 20 steps, and no time limit is known: "
        "give one (--time-limit N), or train without evaluations (--evaluation-episodes 0)."
    )
    assert sorted(tmp_path.rglob("*")) == before
