"""`detpg plot` through its entry point: what it writes, and what it refuses."""

import json

import polars as pl
import pytest

from detpg.cli import main
from made_runs import write_run

KNOWN = "choose from return, length, rollout/ep_rew_mean, train/td_error."


def test_a_picture_and_its_numbers(tmp_path, capsys: pytest.CaptureFixture[str]):
    path, output = write_run(tmp_path / "run"), tmp_path / "a.b.svg"
    main(["plot", str(path), "--output", str(output)])
    assert capsys.readouterr().out == f"written to {output} and {tmp_path / 'a.b.csv'}\n"
    assert "<svg" in output.read_text()
    assert pl.read_csv(tmp_path / "a.b.csv").height == 3 * (1 + 3)


@pytest.mark.parametrize(("metric", "name"), [("return", "return"), ("train/td_error", "td_error")])
def test_the_file_is_named_after_the_metric(
    metric, name, tmp_path, monkeypatch: pytest.MonkeyPatch
):
    write_run(tmp_path / "run")
    monkeypatch.chdir(tmp_path)
    main(["plot", "run", "--metric", metric])
    assert {found.name for found in tmp_path.iterdir()} == {"run", f"{name}.png", f"{name}.csv"}


def test_the_ending_says_the_kind_in_any_case(tmp_path):
    main(["plot", str(write_run(tmp_path / "run")), "--output", str(tmp_path / "curve.PDF")])
    assert (tmp_path / "curve.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "no run is named"),
        (["nowhere"], "nowhere is not a run: name a folder that `detpg train` has written."),
        (["study"], "study is not a run: name a folder that `detpg train` has written."),
        (["broken"], "broken is not a run: name a folder that `detpg train` has written."),
        (["run", "--metric", "loss"], f"run has no metric 'loss': {KNOWN}"),
        (["new"], "new has not been evaluated yet: wait for its first evaluation."),
        (["new", "--metric", "train/value"], "choose from return, length."),
        (["run", "new"], "new has not been evaluated yet"),
        (["run", "--output", "curve.jpg"], "curve.jpg is of no known kind: let it end with"),
        (["run", "--output", "none/a.png"], "none/a.png cannot be written to (No such file"),
    ],
)
def test_what_cannot_be_used_is_refused(
    words, said, tmp_path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    write_run(tmp_path / "run")
    (write_run(tmp_path / "new") / "evaluations.parquet").unlink()
    (tmp_path / "new" / "metrics.parquet").unlink()
    (write_run(tmp_path / "study") / "config.json").write_text(json.dumps({"detpg": "0.1.0"}))
    (write_run(tmp_path / "broken") / "config.json").write_text("{")
    before = sorted(tmp_path.iterdir())
    with pytest.raises(SystemExit) as ended:
        main(["plot", *words])
    assert ended.value.code == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert sorted(tmp_path.iterdir()) == before
