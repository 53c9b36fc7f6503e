"""Tasks one after the other, in this process."""

import dataclasses
from collections.abc import Callable, Hashable, Iterator, Sequence
from typing import Any, Self


@dataclasses.dataclass(frozen=True)
class InProcess:
    """The executor without processes.

    Attributes:
        work: What is called with each task.
    """

    work: Callable[[Any], Any]

    def run(self, tasks: Sequence[Any], groups: Sequence[Hashable]) -> Iterator[tuple[int, Any]]:
        """Yields (index, work(task)) for each task, in order; groups are not needed here."""
        for index, task in enumerate(tasks):
            yield index, self.work(task)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing to end."""
