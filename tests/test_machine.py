"""What is free is found where the system says it, and nowhere else."""

import pytest

from detpg import machine

MEMINFO = "MemTotal:       24000000 kB\nMemFree:  1 kB\nMemAvailable:   16000000 kB\n"


@pytest.fixture
def files(tmp_path, monkeypatch):
    free, limit, used = (tmp_path / name for name in ("meminfo", "limit", "used"))
    monkeypatch.setattr(machine, "MEMINFO", str(free))
    monkeypatch.setattr(machine, "GROUPS", ((str(limit), str(used)),))
    return free, limit, used


def test_what_is_available_counts(files):
    files[0].write_text(MEMINFO)
    assert machine.memory() == 16_000_000 * 1024


@pytest.mark.parametrize(("limit", "free"), [("3000", 1000), ("max", 16_384_000_000), ("1", 0)])
def test_a_control_group_may_leave_less(files, limit, free):
    for file, text in zip(files, (MEMINFO, limit, "2000")):
        file.write_text(text)
    assert machine.memory() == free


def test_elsewhere_it_is_all_there_is_or_unknown(files, monkeypatch):
    pages = {"SC_PHYS_PAGES": 1000, "SC_PAGE_SIZE": 4096}
    monkeypatch.setattr("os.sysconf", pages.__getitem__, raising=False)
    assert machine.memory() == 4_096_000
    monkeypatch.delattr("os.sysconf")
    assert machine.memory() is None
