"""`detpg verify` through its entry point, with few and cheap checks."""

import json
from pathlib import Path

import pytest

import detpg.theorems
from detpg.cli import main
from detpg.theorems import GROUPS, Group, natural_gradient, verify
from detpg.theorems.record import check, points

KEYS = {"id", "statement", "passed", "measured", "expected", "tolerance"}


def few() -> Group:
    rows = points("sigma", "relative error", "a line", [0.1, 0.2], [1.0, 2.0], 0.1)
    return Group("A title", (check("theorem-1/a", "twice one is two", 2.0, 2.0, 0.1),), rows)


def failing() -> Group:
    return Group("Another", (check("theorem-2/b", "one is two", [1.0, 2.0], 2.0, 0.1),), ())


@pytest.fixture
def groups(monkeypatch: pytest.MonkeyPatch) -> dict:
    """What the command runs: one group that passes, unless a test says otherwise."""
    chosen = {"theorem-1": few}
    monkeypatch.setattr(detpg.theorems, "GROUPS", chosen)
    return chosen


def test_json_is_all_that_is_printed(groups, capsys: pytest.CaptureFixture[str]):
    groups["natural-gradient"] = natural_gradient.run
    main(["verify", "--json"])
    said = capsys.readouterr()
    found = json.loads(said.out)
    assert set(found) == {"checks"}
    assert all(set(record) == KEYS for record in found["checks"])
    assert [record["id"] for record in found["checks"]] == [
        "theorem-1/a",
        "natural-gradient/network",
        "natural-gradient/lqr",
        "natural-gradient/fisher-limit",
    ]
    assert all(record["passed"] is True for record in found["checks"])
    assert found["checks"][0]["measured"] == 2.0
    assert len(found["checks"][2]["measured"]) == 6
    assert said.err == ""


@pytest.mark.parametrize("words", [[], ["--json"]])
def test_a_failing_check_ends_with_code_1(groups, words, capsys: pytest.CaptureFixture[str]):
    groups["theorem-2"] = failing
    with pytest.raises(SystemExit) as ended:
        main(["verify", *words])
    assert ended.value.code == 1
    said = capsys.readouterr().out
    if words:
        assert [record["passed"] for record in json.loads(said)["checks"]] == [True, False]
    else:
        assert "1 of 2 checks passed; failed: theorem-2/b" in said


def test_text_shows_numbers_and_verdicts(groups, capsys: pytest.CaptureFixture[str]):
    main(["verify"])
    said = capsys.readouterr()
    for words in ("A title", "twice one is two", "measured", "expected", "yes", "1 of 1 checks"):
        assert words in said.out
    assert "verify: theorem-1" in said.err


def test_files_are_written(groups, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    main(["verify", "--output", str(tmp_path / "new" / "here")])
    assert {p.name for p in (tmp_path / "new" / "here").iterdir()} == {
        "checks.json",
        "checks.md",
        "points.csv",
        "theorem-1.png",
        "theorem-1.svg",
    }
    assert "written to" in capsys.readouterr().out


def test_failures_are_written_too(groups, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    groups["theorem-2"] = failing
    with pytest.raises(SystemExit):
        main(["verify", "--json", "--output", str(tmp_path)])
    assert "**no**" in (tmp_path / "checks.md").read_text()
    json.loads(capsys.readouterr().out)


def refuse() -> Group:
    raise AssertionError("Nothing may run before the folder is known to be usable.")


@pytest.mark.parametrize("place", ["/proc/nowhere", "a-file", "a-file/below"])
def test_a_folder_that_cannot_be_used_is_one_sentence(
    groups, place: str, tmp_path: Path, monkeypatch, capsys: pytest.CaptureFixture[str]
):
    groups["theorem-1"] = refuse
    monkeypatch.chdir(tmp_path)
    Path("a-file").write_text("mine")
    with pytest.raises(SystemExit) as ended:
        main(["verify", "--output", place])
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith(f"detpg: {place} cannot be written to")
    assert said.count("\n") == 1
    assert Path("a-file").read_text() == "mine"


def test_every_group_is_told_before_it_runs(groups):
    told = []
    groups["theorem-2"] = failing
    assert list(verify(told.append)) == told == ["theorem-1", "theorem-2"]
    assert len(GROUPS) == 8
