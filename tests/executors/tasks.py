"""Work for worker processes, which import it by name."""

import os
import signal


def square(task: int) -> tuple[int, int]:
    return task * task, os.getpid()


def fail(task: int) -> int:
    raise ValueError(f"task {task} is bad")


def die(task: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return task


def threads(task: int) -> str | None:
    return os.environ.get("NPROC")
