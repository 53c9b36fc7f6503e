"""What a task gives to the compiled loop."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np


@dataclasses.dataclass(frozen=True)
class Task:
    """An environment of `detpg.environments` as compiled functions.

    Attributes:
        constants: The numbers of the environment, in the order in which the functions read them.
        start: (constants, stream, state): writes the first state.
        move: (constants, stream, state, action) -> (reward, terminated): writes the next state.
        solved: Return of the mean policy above which a run counts as solved.
    """

    constants: Callable[[Any], np.ndarray]
    start: Callable[..., Any]
    move: Callable[..., Any]
    solved: float
