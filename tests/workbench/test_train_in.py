"""Runs in a directory: resumed, damaged, refused, lost."""

import errno
import json
import os
import pickle
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import unstoppable
from tensorboardX.proto.event_pb2 import Event

from detpg.runs import RunDirectoryError, checkpoints
from detpg.workbench import Config, DivergedError, open_run, train_in

SMALL = {"log_every": 20, "evaluate_every": 40, "checkpoint_every": 40, "evaluation_episodes": 2}
LQR = {"environment": "lqr", "time_limit": 20}


def config(**changes) -> Config:
    return Config(**{"algorithm": "opdac", "steps": 160, "seeds": 2} | LQR | SMALL | changes)


def contents(path: Path) -> dict[str, object]:
    """All that says how a run went, apart from its times."""
    arrays = {
        name: {key: value.tobytes() for key, value in np.load(path / name).items()}
        for name in ("best.npz", "last.npz")
    }
    tables = {n: pq.read_table(path / n).to_pylist() for n in unstoppable.TABLES}
    return arrays | tables


def told(path: Path, run: Config, **options) -> list[str]:
    """The messages of a run."""
    found: list[str] = []
    train_in(path, run, report=lambda progress: found.extend(progress.messages), **options)
    return found


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of 160 steps that nothing disturbed."""
    path = tmp_path_factory.mktemp("whole") / "run"
    assert train_in(path, config()).finished
    return path


def test_two_halves_are_a_whole(whole, tmp_path):
    assert train_in(tmp_path / "run", config(steps=80)).step == 80
    assert train_in(tmp_path / "run", config()).step == 160
    assert contents(tmp_path / "run") == contents(whole)


def test_a_run_that_is_stopped_goes_on_where_it_stood(whole, tmp_path):
    asked = iter([False, True])
    ended = train_in(tmp_path / "run", config(), should_stop=lambda: next(asked))
    assert (ended.step, ended.finished) == (40, False)
    assert train_in(tmp_path / "run", config()).finished
    assert contents(tmp_path / "run") == contents(whole)


def test_a_run_holds_what_it_should(whole):
    names = {path.name for path in whole.iterdir()}
    assert names == {
        "best.npz",
        "checkpoints",
        "command.txt",
        "config.json",
        "evaluations.parquet",
        "last.npz",
        "metrics.parquet",
        "provenance.json",
        "tensorboard",
    }
    metrics = pq.read_table(whole / "metrics.parquet").to_pylist()
    assert [(row["step"], row["seed"]) for row in metrics] == [
        (step, seed) for step in range(20, 161, 20) for seed in (0, 1)
    ]
    assert metrics[0]["rollout/ep_len_mean"] == 20
    rows = pq.read_table(whole / "evaluations.parquet").to_pylist()
    assert sorted({row["step"] for row in rows}) == [0, 40, 80, 120, 160]
    assert len(rows) == 5 * 2 * 2
    means = {
        (row["step"], row["seed"]): row["eval/mean_reward"]
        for row in metrics
        if row["eval/mean_reward"] is not None
    }
    for (step, seed), mean in means.items():
        own = [r["return"] for r in rows if (r["step"], r["seed"]) == (step, seed)]
        assert mean == pytest.approx(np.mean(own))
    assert len(list((whole / "tensorboard").glob("seed*/events*"))) == 2


@pytest.mark.slow
def test_every_algorithm_survives_being_killed_at_any_moment(tmp_path):
    """A real process, `kill -9` at random moments; what is left in the end is the same."""
    script = Path(unstoppable.__file__)

    def start(folder: str) -> subprocess.Popen[bytes]:
        call = [sys.executable, str(script), str(tmp_path / folder)]
        return subprocess.Popen(call, stdout=subprocess.DEVNULL)

    began = time.monotonic()
    undisturbed = start("undisturbed")
    assert undisturbed.wait(timeout=500) == 0
    took = time.monotonic() - began
    moments = np.random.default_rng(int(began)).uniform(0.3, 0.9, 2) * took
    print("killed after", moments)
    for moment in moments:
        process = start("killed")
        time.sleep(moment)
        process.send_signal(signal.SIGKILL)
        process.wait(timeout=60)
    assert start("killed").wait(timeout=500) == 0
    for name in unstoppable.RUNS:
        one, other = (contents(tmp_path / folder / name) for folder in ("undisturbed", "killed"))
        assert one == other, name


def damage(path: Path, step: int, how: str) -> None:
    """Spoils the largest file of a checkpoint."""
    files = [file for file in (path / "checkpoints" / f"{step:012d}").rglob("*") if file.is_file()]
    victim = max(files, key=lambda file: file.stat().st_size)
    content = bytearray(victim.read_bytes())
    if how == "cut":
        victim.write_bytes(content[: len(content) // 2])
    elif how == "flipped":
        content[len(content) // 2] ^= 1
        victim.write_bytes(content)
    else:
        victim.unlink()


@pytest.mark.parametrize("how", ["cut", "flipped", "gone"])
def test_a_damaged_checkpoint_is_named_and_the_one_before_it_is_used(whole, tmp_path, how):
    shutil.copytree(whole, tmp_path / "run")
    damage(tmp_path / "run", 160, how)
    messages = told(tmp_path / "run", config())
    assert messages == ["checkpoint 000000000160 is damaged: the one before it is used."]
    assert contents(tmp_path / "run") == contents(whole)


def test_where_all_are_damaged_it_starts_anew(whole, tmp_path):
    shutil.copytree(whole, tmp_path / "run")
    for digest in (tmp_path / "run" / "checkpoints").glob("*.json"):
        damage(tmp_path / "run", int(digest.stem), "cut")
    assert len(told(tmp_path / "run", config())) == 3
    assert contents(tmp_path / "run") == contents(whole)


def test_a_full_disk_leaves_the_last_good_state(whole, tmp_path, monkeypatch):
    train_in(tmp_path / "run", config(steps=80))

    def full(folder, content):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patched:
        patched.setattr(checkpoints, "_write", full)
        with pytest.raises(RunDirectoryError, match=r"No space left.*the last good one is 80\.$"):
            train_in(tmp_path / "run", config())
    assert train_in(tmp_path / "run", config()).finished
    assert contents(tmp_path / "run") == contents(whole)


def events(path: Path) -> list[Event]:
    """In the order in which they were written."""
    found = []
    for file in sorted(path.glob("events*"), key=lambda file: file.stat().st_mtime_ns):
        content = file.read_bytes()
        while content:  # length, checksum, event, checksum
            size = int.from_bytes(content[:8], "little")
            found.append(Event.FromString(content[12 : 12 + size]))
            content = content[16 + size :]
    return found


def test_no_scalar_is_lost_or_doubled_by_resuming(tmp_path):
    """A reader drops what stands at or after the step of a start."""
    for steps in (40, 80):
        train_in(tmp_path, config(steps=steps))
    shown: list[int] = []
    for event in events(tmp_path / "tensorboard" / "seed0"):
        if event.HasField("session_log"):
            shown = [step for step in shown if step < event.step]
        shown += [event.step for value in event.summary.value if value.tag == "train/td_error"]
    assert shown == [20, 40, 60, 80]


def test_another_run_is_refused_and_untouched(whole):
    before = contents(whole)
    with pytest.raises(RunDirectoryError, match=r"^--steps 120 lies behind step 160, which "):
        train_in(whole, config(steps=120))
    with pytest.raises(RunDirectoryError, match=r"another run \(different: options\): choose"):
        train_in(whole, config(options={"alpha_w": 0.5}))
    assert contents(whole) == before


@pytest.mark.parametrize("content", ["{}", "no JSON", '{"detpg": 1}', "[]"])
def test_a_folder_of_somebody_else_is_refused(tmp_path, content):
    (tmp_path / "config.json").write_text(content)
    with pytest.raises(RunDirectoryError, match=r"is no run of `detpg train`"):
        train_in(tmp_path, config())
    assert [path.name for path in tmp_path.iterdir()] == ["config.json"]


def test_a_run_that_diverges_says_what_and_when(tmp_path):
    options = {"alpha_w": 1e5, "alpha_theta": 1e5}
    with pytest.raises(DivergedError, match=r"^The run diverged: the .* of step \d+ is not finite"):
        train_in(tmp_path / "run", config(options=options, steps=1000, normalise="none"))


class Runs:
    """What a pickle would do when it is loaded."""

    def __reduce__(self):
        return (os.mkdir, ("pwned",))


def test_nothing_that_is_loaded_runs_code(whole, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(whole, tmp_path / "run")
    evil = np.array([Runs()], dtype=object)
    np.savez(tmp_path / "run" / "best.npz", leaf0=evil, best_return=evil)
    (tmp_path / "run" / "last.npz").write_bytes(pickle.dumps(Runs()))
    for which in ("best", "last"):
        with pytest.raises(RunDirectoryError, match=f"^The {which} policy of .* is damaged"):
            open_run(tmp_path / "run").controller(which)
    found = json.loads((tmp_path / "run" / "config.json").read_text())
    found["run"]["policy"] = "evil.py:policy"
    (tmp_path / "evil.py").write_text("import os\nos.mkdir('pwned')\n")
    (tmp_path / "run" / "config.json").write_text(json.dumps(found))
    with pytest.raises(RunDirectoryError, match=r"code is never loaded from a run\.$"):
        open_run(tmp_path / "run")
    assert not (tmp_path / "pwned").exists()


def test_no_file_of_a_run_is_a_pickle(whole):
    for path in (path for path in whole.rglob("*") if path.is_file()):
        content = path.read_bytes()
        assert not (content[:1] == b"\x80" and content[-1:] == b"."), path
        if path.suffix == ".npz":
            arrays = np.load(path, allow_pickle=False)
            assert all(arrays[name].dtype != object for name in arrays.files)


def test_an_opened_run_plays_what_was_trained(whole):
    run = open_run(whole)
    assert run.play("best", 1).column_names == ["seed", "episode", "return", "length"]
    many = [np.mean(run.play("last", 200, seed)["return"].to_numpy()) for seed in (0, 1)]
    rows = pq.read_table(whole / "evaluations.parquet").to_pylist()
    last = [row["return"] for row in rows if row["step"] == 160]
    assert many[0] != many[1]
    assert not set(last) & set(run.play("last", 2, 0)["return"].to_pylist())
    spread = np.std(run.play("last", 200, 0)["return"].to_numpy())
    assert np.mean(last) == pytest.approx(many[0], abs=4.5 * spread / len(last) ** 0.5)
    with pytest.raises(RunDirectoryError, match=r"has the seeds 0 to 1, not 7"):
        run.controller("best", 7)
