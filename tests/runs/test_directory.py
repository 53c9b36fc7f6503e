import json
import multiprocessing
from pathlib import Path

import numpy as np
import pytest

from detpg.runs import RunDirectory, RunDirectoryError, write_atomically

CONFIG = {"name": "a", "seed": 1}


def contents(path: Path) -> dict[str, bytes]:
    return {str(p.relative_to(path)): p.read_bytes() for p in path.rglob("*") if p.is_file()}


def refused(words: str):
    return pytest.raises(RunDirectoryError, match=words)


def enter(run: RunDirectory, fresh: bool = False) -> RunDirectory:
    with run.opened(fresh):
        return run


def test_a_failed_write_leaves_what_was_there(tmp_path: Path):
    path = tmp_path / "file"
    write_atomically(path, lambda file: file.write(b"old"))

    def half(file):
        file.write(b"ne")
        raise RuntimeError("full")

    with pytest.raises(RuntimeError, match="full"):
        write_atomically(path, half)
    assert contents(tmp_path) == {"file": b"old"}


def test_opening_again_keeps_everything(tmp_path: Path):
    run = RunDirectory(tmp_path / "run", CONFIG)
    with run.opened():
        run.save_shard("s", np.arange(3.0))
    before = contents(tmp_path)
    with RunDirectory(tmp_path / "run", CONFIG).opened():
        pass
    assert contents(tmp_path) == before
    assert not run.finished


def test_another_configuration_is_refused_and_nothing_touched(tmp_path: Path):
    with RunDirectory(tmp_path, CONFIG).opened():
        pass
    before = contents(tmp_path)
    with refused(r"another configuration \(different: seed\)"):
        enter(RunDirectory(tmp_path, CONFIG | {"seed": 2}))
    assert contents(tmp_path) == before


def test_fresh_starts_over(tmp_path: Path):
    old = enter(RunDirectory(tmp_path, CONFIG))
    old.save_shard("s", np.zeros(1))
    old.finish({})
    (tmp_path / "claims.md").write_text("old")
    (tmp_path / "finding.md").write_text("mine")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "mine.png").write_bytes(b"mine")
    new = enter(RunDirectory(tmp_path, CONFIG | {"seed": 2}), fresh=True)
    assert not new.finished
    assert sorted(contents(tmp_path)) == ["config.json", "finding.md", "folder/mine.png"]
    assert new.shard("s") is None
    assert json.loads((tmp_path / "config.json").read_text())["seed"] == 2


@pytest.mark.parametrize("fresh", [False, True])
def test_a_folder_that_is_not_ours_is_refused(tmp_path: Path, fresh: bool):
    (tmp_path / "thesis.tex").write_text("years of work")
    with refused("not a run of detpg"):
        enter(RunDirectory(tmp_path, CONFIG), fresh)
    assert contents(tmp_path) == {"thesis.tex": b"years of work"}


@pytest.mark.parametrize("config", ['{"model": "bert"}', "[1, 2]"])
def test_somebody_elses_config_is_refused_also_with_fresh(tmp_path: Path, config: str):
    (tmp_path / "config.json").write_text(config)
    (tmp_path / "weights.bin").write_bytes(b"dear")
    before = contents(tmp_path)
    for fresh in (False, True):
        with refused("not a run of detpg"):
            enter(RunDirectory(tmp_path, CONFIG), fresh)
    assert contents(tmp_path) == before


def test_what_a_killed_process_left_half_written_is_removed(tmp_path: Path):
    (tmp_path / ".config.json.123.part").write_text("{")
    run = enter(RunDirectory(tmp_path, CONFIG))
    (tmp_path / ".sweep.parquet.123.part").write_text("PAR1")
    enter(run)
    assert sorted(contents(tmp_path)) == ["config.json"]


def test_a_run_killed_while_it_finished_is_tidied(tmp_path: Path):
    run = enter(RunDirectory(tmp_path, CONFIG))
    run.save_shard("s", np.zeros(1))
    (tmp_path / "summary.json").write_text("{}")
    enter(run)
    assert sorted(contents(tmp_path)) == ["config.json", "summary.json"]


def test_a_file_in_the_way_is_refused(tmp_path: Path):
    (tmp_path / "run").write_text("")
    with refused("not a directory"):
        enter(RunDirectory(tmp_path / "run", CONFIG))


def test_a_damaged_config_is_refused(tmp_path: Path):
    (tmp_path / "config.json").write_text("{")
    with refused("cannot be read"):
        enter(RunDirectory(tmp_path, CONFIG))


def test_an_unwritable_place_is_refused():
    with refused("cannot be written to"):
        enter(RunDirectory(Path("/proc/detpg"), CONFIG))


def test_shards_survive_and_damaged_ones_are_absent(tmp_path: Path):
    run = enter(RunDirectory(tmp_path, CONFIG))
    result = np.arange(12, dtype=np.float32).reshape(3, 4)
    run.save_shard("whole", result)
    np.testing.assert_array_equal(run.shard("whole"), result)
    assert run.shard("absent") is None
    path = tmp_path / "shards" / "whole.npy"
    for damaged in (b"", path.read_bytes()[:-5], b"nonsense" * 20):
        path.write_bytes(damaged)
        assert run.shard("whole") is None


def test_a_shard_cannot_carry_code(tmp_path: Path):
    run = enter(RunDirectory(tmp_path, CONFIG))
    # The one place that pickles: it makes the file that must not be loaded.
    np.save(tmp_path / "shards" / "evil.npy", np.array([print], dtype=object), allow_pickle=True)
    assert run.shard("evil") is None


def test_finishing_removes_the_shards(tmp_path: Path):
    run = enter(RunDirectory(tmp_path, CONFIG))
    run.save_shard("s", np.zeros(1))
    run.finish({"claims": []})
    assert run.finished
    assert sorted(contents(tmp_path)) == ["config.json", "summary.json"]


def hold(path: Path, ready, done):
    with RunDirectory(path, CONFIG).opened():
        ready.set()
        done.wait(30)


def test_a_second_process_is_kept_out(tmp_path: Path):
    run = enter(RunDirectory(tmp_path, CONFIG))
    context = multiprocessing.get_context("spawn")
    ready, done = context.Event(), context.Event()
    other = context.Process(target=hold, args=(tmp_path, ready, done))
    other.start()
    assert ready.wait(30)
    before = contents(tmp_path)
    for fresh in (False, True):
        with refused("in use by another process"):
            enter(run, fresh)
    assert contents(tmp_path) == before
    done.set()
    other.join(30)
    enter(run)


def test_seconds_are_kept(tmp_path: Path):
    run = enter(RunDirectory(tmp_path, CONFIG))
    assert run.seconds == 0
    run.seconds = 12.5
    assert RunDirectory(tmp_path, CONFIG).seconds == 12.5
