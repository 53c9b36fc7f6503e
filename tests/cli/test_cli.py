"""The command line through its entry point, in processes of its own."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from detpg import ALGORITHMS, ENVIRONMENTS

VERDICTS = {"reproduced", "not reproduced", "inconclusive"}


def detpg(*words: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    call = [sys.executable, "-m", "detpg", *words]
    return subprocess.run(call, capture_output=True, text=True, cwd=cwd, check=False)


def contents(path: Path) -> dict[str, bytes]:
    return {str(p.relative_to(path)): p.read_bytes() for p in path.rglob("*") if p.is_file()}


@pytest.fixture(scope="module")
def smoke(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """One run of the smoke preset, shared by what only reads it."""
    output = tmp_path_factory.mktemp("smoke")
    done = detpg("reproduce", "figure1", "--preset", "smoke", "--output", str(output))
    assert done.returncode == 0, done.stderr
    return output, done.stdout


def refused(done: subprocess.CompletedProcess[str], *words: str) -> None:
    """One sentence on standard error, exit code 2, no traceback."""
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    for word in words:
        assert word in done.stderr


def test_help_does_not_import_jax():
    code = "import sys, detpg.cli.main; sys.exit('jax' in sys.modules or 'numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


COMMANDS = (
    "train",
    "resume",
    "evaluate",
    "plot",
    "render",
    "export",
    "check-env",
    "reproduce",
    "verify",
    "list",
)


@pytest.mark.parametrize("command", [(), *((name,) for name in COMMANDS)])
def test_every_command_has_help(command: tuple[str, ...]):
    done = detpg(*command, "--help")
    assert done.returncode == 0
    assert "usage: detpg" in done.stdout


def test_list_names_what_there_is():
    found = json.loads(detpg("list", "--json").stdout)
    assert [row["name"] for row in found["environments"]] == list(ENVIRONMENTS)
    assert [row["name"] for row in found["algorithms"]] == list(ALGORITHMS)
    assert all(row["equations"] for row in found["algorithms"])
    assert found["studies"][0]["presets"] == ["smoke", "quick", "paper"]
    table = detpg("list").stdout
    for row in (*found["environments"], *found["studies"]):
        assert row["name"] in table


def test_everything_is_written(smoke: tuple[Path, str]):
    output, said = smoke
    assert {p.name for p in (output / "figure1").iterdir()} == {
        "config.json",
        "summary.json",
        "claims.md",
        "curves.parquet",
        "sweep.parquet",
        "bands.parquet",
        "scores.parquet",
        "figure1.png",
        "figure1.svg",
        "figure1.pdf",
        "readings.png",
        "fixed_sigma.png",
        "sensitivity.png",
    }
    assert str(output / "figure1" / "figure1.png") in said
    assert str(output / "figure1" / "claims.md") in said


def test_the_summary_is_whole(smoke: tuple[Path, str]):
    summary = json.loads((smoke[0] / "figure1" / "summary.json").read_text())
    assert (summary["figure"], summary["preset"], summary["seed"]) == ("figure1", "smoke", 0)
    assert summary["wall_seconds"] > 0
    assert summary["provenance"]["command"].endswith(f"--output {smoke[0].name}")
    for claim in summary["claims"]:
        assert claim["verdict"] in VERDICTS
        assert claim["num_runs"] + claim["num_diverged"] <= 10
        low, high = claim["interval"]
        if None not in (low, claim["measured"], high):
            assert low <= claim["measured"] <= high


def test_the_paper_s_direction_shows(smoke: tuple[Path, str]):
    """At the same fixed width COPDAC-B ends far below REINFORCE, in every dimension."""
    claims = {
        claim["id"]: claim
        for claim in json.loads((smoke[0] / "figure1" / "summary.json").read_text())["claims"]
    }
    for m in (10, 25, 50):
        claim = claims[f"fixed-both-0.1/m-{m}/mixed/score-times-q"]
        assert claim["interval"][0] > 100


def test_a_finished_study_is_not_run_again(smoke: tuple[Path, str]):
    before = contents(smoke[0])
    done = detpg("reproduce", "figure1", "--preset", "smoke", "--output", str(smoke[0]))
    assert done.returncode == 0
    assert "already finished" in done.stdout
    assert contents(smoke[0]) == before


def test_where_a_picture_is_missing_all_are_drawn_again_to_the_same_bytes(smoke: tuple[Path, str]):
    before = contents(smoke[0])
    (smoke[0] / "figure1" / "figure1.svg").unlink()
    done = detpg("reproduce", "figure1", "--preset", "smoke", "--output", str(smoke[0]))
    assert done.returncode == 0
    assert contents(smoke[0]) == before


@pytest.mark.parametrize("different", [("--seed", "1"), ("--preset", "paper")])
def test_another_configuration_is_refused(smoke: tuple[Path, str], different: tuple[str, str]):
    before = contents(smoke[0])
    words = ["--preset", "smoke", "--output", str(smoke[0]), *different]
    refused(detpg("reproduce", "figure1", *words), "another configuration", different[0][2:])
    assert contents(smoke[0]) == before


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("figure7",), ("'figure7'", "figure1")),
        (("figure1", "--seed", "-1"), ("--seed -1", "2147483647")),
        (("figure1", "--seed", str(2**31)), ("2147483648",)),
        (("figure1", "--seed", "many"), ("seed",)),
        (("figure1", "--workers", "0"), ("--workers 0", "cores")),
        (("figure1", "--workers", "100000"), ("100000", "cores")),
        (("figure1", "--preset", "huge"), ("huge",)),
        (("figure1", "--output", "/proc/nowhere"), ("/proc/nowhere", "--output")),
    ],
)
def test_bad_input_is_one_sentence(tmp_path: Path, words: tuple[str, ...], named: tuple[str, ...]):
    refused(detpg("reproduce", *words, cwd=tmp_path), *named)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_control_c_keeps_what_is_done(tmp_path: Path):
    call = [sys.executable, "-m", "detpg", "reproduce", "--preset", "smoke", "--output", "here"]
    with subprocess.Popen(
        call, stderr=subprocess.PIPE, text=True, cwd=tmp_path, start_new_session=True
    ) as process:
        shards = tmp_path / "here" / "figure1" / "shards"
        deadline = time.monotonic() + 60
        while not list(shards.glob("*.npy")) and time.monotonic() < deadline:
            time.sleep(0.05)
        os.killpg(process.pid, signal.SIGINT)
        assert process.stderr is not None
        said = process.stderr.read()
        assert process.wait(30) == 130
    assert "Traceback" not in said
    assert "run the same command again" in said
    assert list(shards.glob("*.npy"))
    assert not list(shards.glob(".*"))
