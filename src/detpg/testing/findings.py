"""What a check of somebody else's world found: levels, words, advice."""

import dataclasses
from collections.abc import Iterable
from itertools import islice
from typing import Literal

Level = Literal["problem", "warning", "fine"]
NAMED = 5  # components; the others are counted
LONGEST = 400  # characters of what was found: other libraries print whole arrays


@dataclasses.dataclass(frozen=True)
class Finding:
    """One thing that was looked at.

    Attributes:
        level: "problem": learning fails or learns something else; "warning": it may be harder than
            it need be; "fine".
        check: What was looked at.
        found: What there is, in a sentence.
        advice: What to do about it; empty where there is nothing to do.
    """

    level: Level
    check: str
    found: str
    advice: str = ""

    def __post_init__(self):
        if len(self.found) > LONGEST:
            object.__setattr__(self, "found", f"{self.found[: LONGEST - 4].rstrip()} ...")


def problem(check: str, found: str, advice: str) -> Finding:
    """Learning fails, or learns something else."""
    return Finding("problem", check, found, advice)


def warning(check: str, found: str, advice: str) -> Finding:
    """Learning may be harder than it need be."""
    return Finding("warning", check, found, advice)


def fine(check: str, found: str) -> Finding:
    """Nothing to do."""
    return Finding("fine", check, found)


def components(names: Iterable[str], number: int) -> str:
    """The first few of so many components, and how many more there are."""
    more = f" and {number - NAMED} more" if number > NAMED else ""
    return f"component {', '.join(islice(names, NAMED))}{more}"
