"""Stop 7: studies as data, the sweep that runs them, selection on held-out seeds, claims.

In: a study's name, a preset, a seed. Out: tidy tables and judged claims in a run directory.
Next: `detpg.figures` draws them.
"""

from detpg.experiments.figure1 import FIGURE1
from detpg.experiments.figure2 import FIGURE2
from detpg.experiments.figure3 import FIGURE3
from detpg.experiments.study import Study

STUDIES: dict[str, Study] = {
    "figure1": FIGURE1,
    "figure2": FIGURE2,
    "figure3": FIGURE3,
}

__all__ = ["STUDIES", "Study"]
