"""A row of the table of benchmarks."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Row:
    """One measurement.

    Attributes:
        id: Dotted name; `make bench ONLY=` takes a prefix of it.
        value: Ours.
        unit: Of value and baseline.
        baseline: The other's, measured in the same run.
        ratio: Above 1 means that ours is faster, unless the note says what else it is.
        note: What else a reader needs.
    """

    id: str
    value: float
    unit: str
    baseline: float
    ratio: float
    note: str
