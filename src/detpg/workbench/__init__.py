"""One's own problem: a world or logged data, a controller, a run directory.

In: names or objects of a learner and a world. Out: a run that can be resumed, looked at, exported.
Next: the command line (`detpg.cli`), or the caller.
"""

from detpg.workbench.config import Config
from detpg.workbench.diagnosis import DivergedError
from detpg.workbench.opened import OpenedRun, open_run
from detpg.workbench.run import Progress, Stopped, train_in
from detpg.workbench.session import Session
from detpg.workbench.trainer import Trainer
from detpg.world_error import WorldError

__all__ = [
    "Config",
    "DivergedError",
    "OpenedRun",
    "Progress",
    "Session",
    "Stopped",
    "Trainer",
    "WorldError",
    "open_run",
    "train_in",
]
