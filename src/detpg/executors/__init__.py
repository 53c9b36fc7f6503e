"""Where the shards of a study run: in this process, or in worker processes.

In: a function and tasks. Out: (index, result) pairs, in the order in which they finish.
Next: `detpg.experiments` stores them. A result depends on its task alone, never on the executor.
"""

from detpg.executors.in_process import InProcess
from detpg.executors.processes import Processes, TaskError, WorkerLostError

__all__ = ["InProcess", "Processes", "TaskError", "WorkerLostError"]
