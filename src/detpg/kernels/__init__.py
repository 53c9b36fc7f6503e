"""The tile-coded linear learners of Section 5.2, compiled for one core per run.

In: names of a task and a learner, a grid of hyper-parameters. Out: learning curves.
Next: `detpg.experiments`.

A specialisation, never a second definition: an update touches a few weights of a thousand, which
a compiled loop does faster than XLA. `detpg.algorithms` defines what is computed, and tests
feed both with the same transitions.
"""

from detpg.kernels.learners import LEARNERS
from detpg.kernels.run import Curves, Experience, active_features, replay, run
from detpg.kernels.tasks import TASKS

__all__ = ["LEARNERS", "TASKS", "Curves", "Experience", "active_features", "replay", "run"]
