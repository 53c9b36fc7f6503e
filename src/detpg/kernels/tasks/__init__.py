"""The three tasks of Section 5.2, one file each, by their names in `ENVIRONMENTS`."""

from collections.abc import Mapping
from typing import Any

import jax

from detpg.environments import ENVIRONMENTS
from detpg.kernels.tasks import mountain_car, pendulum, puddle_world
from detpg.kernels.tasks.task import Task

TASKS: dict[str, Task] = {
    "mountain-car": mountain_car.TASK,
    "pendulum": pendulum.TASK,
    "puddle-world": puddle_world.TASK,
}


def environment(name: str, options: Mapping[str, Any]) -> Any:
    """The environment that a task stands for, its numbers in double precision.

    Raises:
        ValueError: A name that has no compiled task.
    """
    if name not in TASKS:
        raise ValueError(f"Task {name!r} is not compiled: choose one of {', '.join(TASKS)}.")
    with jax.enable_x64(True):
        return ENVIRONMENTS[name](**options)


__all__ = ["TASKS", "Task", "environment"]
