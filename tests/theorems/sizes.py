"""The checks in smaller sizes than `detpg verify` runs them in."""

from typing import Any

from detpg.theorems import GROUPS

SMALLER: dict[str, dict[str, Any]] = {
    "theorem-1": {"num_estimates": 32},
    "variance": {"num_states": 4_000},
    "behaviour": {"num_runs": 32},
}


def failed(name: str) -> set[str]:
    """The checks of a group that fail, without the group's name."""
    group = GROUPS[name](**SMALLER.get(name, {}))
    return {check.id.removeprefix(f"{name}/") for check in group.checks if not check.passed}
