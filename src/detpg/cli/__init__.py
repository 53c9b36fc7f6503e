"""The command line: one file per command; JAX is imported by the command that needs it.

In: words typed by a person. Out: files, tables, and one sentence where something is wrong.
"""

from detpg.cli.main import main

__all__ = ["main"]
