"""A whole study: its files, and that interruptions and workers change nothing in them."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from tests.experiments.tiny_study import TIMES, reproduce

TABLES = ("sweep.parquet", "scores.parquet", "curves.parquet", "bands.parquet")


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return reproduce(tmp_path_factory.mktemp("whole"))


def tables(path: Path) -> dict[str, bytes]:
    return {name: (path / name).read_bytes() for name in TABLES}


def start(output: Path, workers: int) -> subprocess.Popen[str]:
    call = [sys.executable, "-m", "tests.experiments.tiny_study", str(output), str(workers)]
    return subprocess.Popen(call, stdout=subprocess.PIPE, text=True, start_new_session=True)


def test_tables_are_tidy_and_complete(finished: Path):
    sweep = pl.read_parquet(finished / "sweep.parquet")
    assert sweep.height == 2 * (8 + 4) * 4 * 100
    key = ["m", "arm", "point", "seed", "step"]
    assert sweep.select(key).is_unique().all()
    curves = pl.read_parquet(finished / "curves.parquet")
    assert set(curves["phase"]) == {"fresh", "interval"}
    assert set(curves.filter(arm="d")["role"]) == {
        "final",
        "mean",
        *(f"{rule} sigma={s}" for rule in ("final", "mean") for s in (0.01, 0.1)),
    }
    assert curves.filter(phase="interval")["seed"].n_unique() == 5


def test_a_diverged_run_is_a_value(finished: Path):
    sweep = pl.read_parquet(finished / "sweep.parquet")
    wild = sweep.filter(arm="s", alpha_theta=1e6)
    assert not wild["finite"].all()
    assert (wild["cost"].is_finite() == wild["finite"]).all()
    assert sweep.filter(arm="d")["finite"].all()
    scores = pl.read_parquet(finished / "scores.parquet").filter(arm="s", alpha_theta=1e6)
    assert (scores["num_diverged"] == 4).all()
    assert scores["final_cost"].is_infinite().all()


def test_bands_are_the_means_of_the_curves(finished: Path):
    curves = pl.read_parquet(finished / "curves.parquet").filter(phase="interval", m=2, arm="s")
    bands = pl.read_parquet(finished / "bands.parquet").filter(phase="interval", m=2, arm="s")
    ours = curves.group_by("role", "step").agg(pl.col("cost").mean()).sort("role", "step")
    theirs = bands.sort("role", "step")
    np.testing.assert_allclose(ours["cost"], theirs["mean"], rtol=1e-5)
    assert (theirs["low"] <= theirs["mean"]).all()
    assert (theirs["mean"] <= theirs["high"]).all()


def test_summary_names_both_scores_and_the_claims(finished: Path):
    summary = json.loads((finished / "summary.json").read_text())
    assert set(summary) == {
        "figure",
        "preset",
        "seed",
        "environment_steps",
        "wall_seconds",
        "selected",
        "claims",
        "provenance",
    }
    runs = 2 * ((8 + 4) * 4 + (6 + 2) * (3 + 5))
    assert summary["environment_steps"] == runs * TIMES[-1]
    row = summary["selected"][0]
    assert row["sweep_score"] > 0
    assert row["fresh_score"] > 0
    assert set(summary["claims"][0]) == {
        "id",
        "statement",
        "published",
        "measured",
        "interval",
        "num_runs",
        "num_diverged",
        "reading",
        "verdict",
    }
    assert "s costs more" in (finished / "claims.md").read_text()
    assert not (finished / "shards").exists()


@pytest.mark.slow
def test_the_number_of_workers_changes_nothing(finished: Path, tmp_path: Path):
    with start(tmp_path, workers=2) as process:
        assert process.wait(120) == 0
    assert tables(tmp_path / "tiny") == tables(finished)


def test_another_seed_changes_the_tables(finished: Path, tmp_path: Path):
    assert tables(reproduce(tmp_path, seed=1)) != tables(finished)


@pytest.mark.slow
@pytest.mark.parametrize(("workers", "kill_after"), [(1, 2), (2, 8)])
def test_killed_and_resumed_gives_the_same_bytes(
    finished: Path, tmp_path: Path, workers: int, kill_after: int
):
    with start(tmp_path, workers) as process:
        assert process.stdout is not None
        while len(list((tmp_path / "tiny" / "shards").glob("*.npy"))) < kill_after:
            assert process.stdout.readline()
        os.kill(process.pid, signal.SIGKILL)
    assert not (tmp_path / "tiny" / "summary.json").exists()
    with start(tmp_path, workers) as process:
        assert process.stdout is not None
        first = process.stdout.readline().split()
        process.stdout.read()
        assert process.wait(120) == 0
    assert first[0] == "sweep"
    assert int(first[1]) > 0
    assert tables(tmp_path / "tiny") == tables(finished)
