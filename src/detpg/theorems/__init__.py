"""The theorems of the paper as checks: what must hold, what was measured, and within what.

In: the library's own environments, actors, critics and learners. Out: judged checks, points.
Next: `detpg.figures` draws the points, `detpg verify` prints the checks.
"""

from collections.abc import Callable

import jax

from detpg.theorems import (
    behaviour_value,
    gradient_q,
    natural_gradient,
    off_policy,
    theorem_1,
    theorem_2,
    theorem_3,
    variance,
)
from detpg.theorems.record import Check, Group, Point

GROUPS: dict[str, Callable[[], Group]] = {
    "theorem-1": theorem_1.run,
    "theorem-2": theorem_2.run,
    "theorem-3": theorem_3.run,
    "off-policy": off_policy.run,
    "variance": variance.run,
    "natural-gradient": natural_gradient.run,
    "behaviour": behaviour_value.run,
    "convergence": gradient_q.run,
}


def verify(begun: Callable[[str], None] = lambda name: None) -> dict[str, Group]:
    """Runs every group of checks in double precision.

    Args:
        begun: Told the name of each group before it runs.
    """
    groups = {}
    with jax.enable_x64(True):
        for name, run in GROUPS.items():
            begun(name)
            groups[name] = run()
    return groups


__all__ = ["GROUPS", "Check", "Group", "Point", "verify"]
