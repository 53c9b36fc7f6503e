"""Where a result came from: versions, commit, machine, command."""

import importlib.metadata
import os
import platform
import subprocess
import sys
from pathlib import Path
from typing import Any

PACKAGES = ("detpg", "jax", "jaxlib", "equinox", "numpy", "pyarrow", "matplotlib")


def provenance(config: dict[str, Any]) -> dict[str, Any]:
    """What another person needs to make the same result, without paths of this machine.

    Args:
        config: The resolved configuration of the run.
    """
    words = [Path(word).name if Path(word).is_absolute() else word for word in sys.argv]
    command = " ".join([Path(words[0]).name, *words[1:]])
    return {
        "command": command,
        "config": config,
        "git": _git(),
        "versions": {
            "python": platform.python_version(),
            **{name: importlib.metadata.version(name) for name in PACKAGES},
        },
        "device": {
            "platform": "cpu",
            "machine": platform.machine(),
            "system": platform.system(),
            "cores": os.cpu_count(),
        },
    }


def _git() -> dict[str, Any] | None:
    """Commit and dirty flag of the source tree; None where detpg is not in a checkout."""

    def git(*arguments: str) -> str:
        call = ["git", "-C", str(Path(__file__).parents[1]), *arguments]
        return subprocess.run(call, capture_output=True, text=True, check=True).stdout.strip()

    try:
        changed = git("status", "--porcelain", ".")  # the sources, not what a run writes
        return {"commit": git("rev-parse", "HEAD"), "dirty": bool(changed)}
    except (OSError, subprocess.CalledProcessError):
        return None
