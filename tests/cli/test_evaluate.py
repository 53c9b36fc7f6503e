"""`detpg evaluate` through its entry point, on a run that plays what it is told to."""

import json

import numpy as np
import pytest

from detpg.cli import main
from detpg.evaluation import summarise
from made_runs import FakeRun, write_run

SEVERAL = [[float(10 * seed + episode) for episode in range(4)] for seed in range(5)]


@pytest.fixture
def opened(tmp_path, monkeypatch: pytest.MonkeyPatch):
    """Puts a run where the command finds it."""

    def put(returns, **config):
        path = write_run(tmp_path / "run", num_seeds=len(returns), **config)
        run = FakeRun(path, returns)
        monkeypatch.setattr("detpg.workbench.open_run", lambda path, own: run, raising=False)
        monkeypatch.setenv("COLUMNS", "80")
        return path, run

    return put


def test_json_has_the_statistics_and_every_episode(opened, capsys: pytest.CaptureFixture[str]):
    path, run = opened(SEVERAL)
    words = ["--json", "--episodes", "4", "--seed", "7", "--policy", "last"]
    main(["evaluate", str(path), *words])
    found = json.loads(capsys.readouterr().out)
    assert run.asked == {"which": "last", "episodes": 4, "seed": 7}
    expected = summarise([np.asarray(returns) for returns in SEVERAL])
    for name in ("mean", "iqm"):
        estimate = getattr(expected, name)
        assert found[name] == {
            "value": float(estimate.value),
            "interval": [float(estimate.low), float(estimate.high)],
        }
    assert found["mean"]["value"] == 21.5
    assert (found["resampled"], found["scores"], found["not_finite"]) == ("runs", 5, 0)
    assert len(found["episodes"]) == 20
    assert found["episodes"][5] == {"seed": 1, "episode": 1, "return": 11.0, "length": 200}


def test_several_seeds_have_a_row_each(opened, capsys: pytest.CaptureFixture[str]):
    path, _ = opened(SEVERAL)
    main(["evaluate", str(path)])
    said = capsys.readouterr().out
    assert "copdac-q in Pendulum-v1, its best policy" in said
    assert "5 training seeds, each the mean of 4 episodes" in said
    assert "too narrow" in said
    assert "each training seed" in said
    assert "each episode" not in said
    assert all(len(line) <= 80 for line in said.splitlines())
    (row,) = (line for line in said.splitlines() if line.startswith("│ 3"))
    numbers = [cell.strip() for cell in row.strip("│").split("│")]
    assert numbers == ["3", "31.50", "31.50", "30.00", "33.00", "200.0"]


def test_every_episode_is_shown_when_told_to(opened, capsys: pytest.CaptureFixture[str]):
    path, _ = opened(SEVERAL)
    main(["evaluate", str(path), "--episodes-table"])
    said = capsys.readouterr().out
    assert "each episode" in said
    assert said.count("200 │") == 20


def test_one_seed_is_judged_by_its_episodes(opened, capsys: pytest.CaptureFixture[str]):
    path, _ = opened([[-150.25, -149.5, -160.0]])
    main(["evaluate", str(path)])
    said = capsys.readouterr().out
    assert "3 episodes of one training seed" in said
    assert "each training seed" not in said
    for number in ("-150.2", "-149.5", "-160.0"):
        assert number in said


def test_what_is_not_finite_is_said(opened, capsys: pytest.CaptureFixture[str]):
    path, _ = opened([[1.0, 2.0], [3.0, float("inf"), -float("inf"), 3.0, 3.0], [5.0, 6.0]])
    main(["evaluate", str(path)])
    said = capsys.readouterr().out
    assert "not finite: 1 of the seeds." in " ".join(said.split())
    (row,) = (line for line in said.splitlines() if line.startswith("│ 1"))
    assert row.count("not finite") == 4
    assert "3.500" in said
    main(["evaluate", str(path), "--json"])
    found = json.loads(capsys.readouterr().out)
    assert found["not_finite"] == 1
    assert found["episodes"][3]["return"] is None


def test_one_episode_has_no_interval(opened, capsys: pytest.CaptureFixture[str]):
    path, _ = opened([[4.0]])
    main(["evaluate", str(path), "--json"])
    assert json.loads(capsys.readouterr().out)["iqm"] == {"value": 4.0, "interval": [None, None]}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nowhere"], "nowhere is not a run: name a folder that `detpg train` has written."),
        (["run", "--episodes", "0"], "--episodes 0 cannot be used: give 1 to 100000."),
        (["run", "--seed", "-1"], "--seed -1 cannot be used: give 0 to 2147483647."),
        (["run"], "run has no best policy yet: wait for its first evaluation"),
    ],
)
def test_what_cannot_be_used_is_refused(
    words, said, opened, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    path, _ = opened([[1.0]])
    (path / "best.npz").unlink()
    monkeypatch.chdir(path.parent)
    with pytest.raises(SystemExit) as ended:
        main(["evaluate", *words])
    assert ended.value.code == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_what_the_run_says_is_one_sentence(
    opened, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    path, _ = opened([[1.0]])

    def fail(path: object, own: object):
        raise ValueError("Mine-v0 is\n  not registered.")

    monkeypatch.setattr("detpg.workbench.open_run", fail)
    with pytest.raises(SystemExit) as ended:
        main(["evaluate", str(path)])
    assert ended.value.code == 2
    assert capsys.readouterr().err == "detpg: Mine-v0 is not registered.\n"
