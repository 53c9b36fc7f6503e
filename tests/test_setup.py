"""What is installed for whom: the locks, and when make installs which."""

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE, TOOLS = "requirements.lock", "requirements-dev.lock"


def pins(lock: str) -> set[str]:
    return set(re.findall(r"^[a-z0-9][^=\s]*==\S+", (ROOT / lock).read_text(), re.MULTILINE))


def names(lock: str) -> set[str]:
    return {pin.split("==")[0] for pin in pins(lock)}


def test_who_reproduces_installs_what_the_package_needs_and_no_tools():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    needed = {re.split(r"[\[>]", need)[0] for need in project["project"]["dependencies"]}
    tools = {need for need in project["dependency-groups"]["dev"] if isinstance(need, str)}
    assert {name.lower() for name in needed} <= names(PACKAGE)
    assert names(PACKAGE).isdisjoint(re.split(r"[\[>]", tool)[0] for tool in tools)
    assert pins(PACKAGE) < pins(TOOLS)


def test_no_lock_names_an_address():
    assert "://" not in (ROOT / PACKAGE).read_text() + (ROOT / TOOLS).read_text()


@pytest.mark.parametrize(
    ("there", "goal", "installed"),
    [
        ([], "reproduce", [PACKAGE]),
        ([], "test", [TOOLS]),
        ([".installed"], "reproduce", []),
        ([".installed"], "test", [TOOLS]),
        ([".installed", ".installed-dev"], "reproduce", []),
        ([".installed", ".installed-dev"], "test", []),
    ],
)
def test_make_installs_once_in_either_order(tmp_path, there, goal, installed):
    for file in ("Makefile", "pyproject.toml", PACKAGE, TOOLS):
        shutil.copy(ROOT / file, tmp_path)
    (tmp_path / ".venv").mkdir()
    for stamp in there:
        (tmp_path / ".venv" / stamp).touch()
    made = subprocess.run(
        ["make", "--dry-run", goal], cwd=tmp_path, capture_output=True, text=True, check=True
    ).stdout
    assert re.findall(r"--require-hashes -r (\S+)", made) == installed
