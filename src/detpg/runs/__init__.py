"""Run directories: configuration, shards, tables, provenance; atomic writes and resume.

In: arrays and records. Out: files that are whole or absent, in formats that cannot carry code.
Next: `detpg.figures` and people read them.
"""

from detpg.runs.arrays import numbered, plain, read_arrays, typed, write_arrays
from detpg.runs.checkpoints import Checkpoints
from detpg.runs.directory import MARK, RunDirectory, write_atomically, write_json
from detpg.runs.lock import RunDirectoryError, locked
from detpg.runs.provenance import provenance
from detpg.runs.tables import TableWriter

__all__ = [
    "MARK",
    "Checkpoints",
    "RunDirectory",
    "RunDirectoryError",
    "TableWriter",
    "locked",
    "numbered",
    "plain",
    "provenance",
    "read_arrays",
    "typed",
    "write_arrays",
    "write_atomically",
    "write_json",
]
