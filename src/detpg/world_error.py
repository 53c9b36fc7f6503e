"""What is told of somebody else's world that fails: the fault is the world's, not the user's."""

import os
import traceback
from typing import Any

TRACEBACK = "DETPG_TRACEBACK"  # an environment variable: where a world raised is shown


class WorldError(Exception):
    """A world raised, or returned what cannot be used; what it raised is the `__cause__`.

    Attributes:
        what: Which world did what, such as "The world 'Tank' raised OSError in step".
        words: What it said or returned, with a full stop.
        index: Which of several worlds, from 0; None where that is not known.
        when: At which step, in words; empty where none is known.
        advice: How to go on, in words; empty where there is nothing to go on with.
        reached: Of the engine that drove the world: its state before the call that failed, and the
            steps that led there; None where there is none.
    """

    def __init__(self, what: str, words: str, index: int | None = None):
        """Says what is known where it happens; whoever catches it knows when."""
        super().__init__(what, words, index)
        self.what, self.words, self.index = what, words, index
        self.when = self.advice = ""
        self.reached: tuple[Any, int] | None = None

    def __str__(self) -> str:
        told = f"{', '.join(filter(None, (self.what, self.when)))}: {self.words}"
        return f"{told} {self.advice}".rstrip()


def sentence(error: Exception) -> str:
    """What another library says, on one line with a full stop."""
    words = " ".join(str(error).split()) or type(error).__name__
    return words if words.endswith((".", "!", "?")) else f"{words}."


def show(error: BaseException) -> bool:
    """Prints the traceback of what a world raised, if that is asked for; whether it was."""
    asked = bool(os.environ.get(TRACEBACK))
    if asked:
        traceback.print_exception(error)
    return asked
