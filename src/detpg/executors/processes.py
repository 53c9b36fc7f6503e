"""Tasks spread over worker processes, each single-threaded.

Processes rather than several XLA devices in one process: on a machine with few cores XLA's shared
thread pool can wait for itself for ever on batched CPU programs (docs/decisions/0008).
"""

import multiprocessing
import os
import signal
import traceback
from collections.abc import Callable, Hashable, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from typing import Any, Self


class WorkerLostError(RuntimeError):
    """A worker process ended before its task did."""


class TaskError(RuntimeError):
    """The work itself failed in a worker; carries the worker's traceback as text."""


def _serve(work: Callable[[Any], Any], connection: Connection) -> None:
    """Answers tasks until the parent closes its end, or dies: then this process ends too."""
    # One thread of XLA, which reads this when it starts: it would hand parts of a program to other
    # threads, and wait for them where the cores are busy (docs/decisions/0008).
    os.environ["NPROC"] = "1"
    try:
        while True:
            task = connection.recv()
            try:
                answer = work(task), None
            except Exception:  # whatever it is: the parent raises it, as text it always travels
                answer = None, traceback.format_exc()
            connection.send(answer)
    except (EOFError, OSError):
        return


class Processes:
    """The executor with `workers` processes, which live until it is closed.

    A worker stays with the programs that it has compiled: it prefers tasks of its own groups, then
    of a group that nobody has begun, and only then helps with the largest.
    """

    def __init__(self, work: Callable[[Any], Any], workers: int):
        """Starts the workers.

        Args:
            work: A function at the top level of a module.
            workers: Number of processes, 1 or more.
        """
        context = multiprocessing.get_context("spawn")
        self._owner: dict[Hashable, int] = {}
        self._connections: list[Connection] = []
        self._processes = []
        # Ctrl-C is the parent's to handle: workers inherit that it is ignored.
        handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
        try:
            for _ in range(workers):
                here, there = context.Pipe()
                process = context.Process(target=_serve, args=(work, there), daemon=True)
                process.start()
                there.close()
                self._connections.append(here)
                self._processes.append(process)
        finally:
            signal.signal(signal.SIGINT, handler)

    def run(self, tasks: Sequence[Any], groups: Sequence[Hashable]) -> Iterator[tuple[int, Any]]:
        """Yields (index, work(task)) as tasks finish, in any order.

        Args:
            tasks: What to call `work` with.
            groups: One for each task; tasks of one group share a compiled program.

        Raises:
            WorkerLostError: A worker was killed, for instance because memory ran out.
            TaskError: The work failed.
        """
        waiting: dict[Hashable, list[int]] = {}
        for index, group in enumerate(groups):
            waiting.setdefault(group, []).append(index)
        busy: dict[Connection, int] = {}

        def hand_out(connection: Connection) -> None:
            index = self._next(waiting, self._connections.index(connection))
            if index is not None:
                _send(connection, tasks[index])
                busy[connection] = index

        for connection in self._connections:
            hand_out(connection)
        while busy:
            for connection in wait(list(busy)):
                assert isinstance(connection, Connection)
                index, result = busy.pop(connection), _receive(connection)
                yield index, result
                hand_out(connection)

    def _next(self, waiting: dict[Hashable, list[int]], worker: int) -> int | None:
        if not waiting:
            return None
        own = [group for group in waiting if self._owner.get(group) == worker]
        new = [group for group in waiting if group not in self._owner]
        largest = max(waiting, key=lambda group: len(waiting[group]))
        group = (own or new or [largest])[0]
        self._owner.setdefault(group, worker)
        index = waiting[group].pop(0)
        if not waiting[group]:
            del waiting[group]
        return index

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes:
            process.terminate()


_LOST = (
    "A worker process was killed before its shard was finished, perhaps because memory ran out: "
    "run the same command again to continue, with fewer --workers if need be."
)


def _send(connection: Connection, task: Any) -> None:
    try:
        connection.send(task)
    except OSError:
        raise WorkerLostError(_LOST) from None


def _receive(connection: Connection) -> Any:
    try:
        result, error = connection.recv()
    except (EOFError, OSError):
        raise WorkerLostError(_LOST) from None
    if error is not None:
        raise TaskError(error)
    return result
