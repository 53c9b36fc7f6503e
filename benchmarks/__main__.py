"""Runs the benchmarks, prints a table, writes build/bench.json."""

import dataclasses
import importlib
import json
import os
import sys
from pathlib import Path

# As on the command line of detpg: one thread per process (docs/decisions/0008), nothing cached,
# so that compilation is measured.
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")

# Each has `IDS` and `rows(wanted)`, which measures some of them. Imported after the above.
MODULES = (
    "benchmarks.compatible",
    "benchmarks.figure1",
    "benchmarks.gymnasium",
    "benchmarks.kernels",
    "benchmarks.octopus",
    "benchmarks.train",
)


def main() -> None:
    """Runs every row whose id begins with the given prefix."""
    from rich.console import Console
    from rich.table import Table

    prefix = sys.argv[1] if len(sys.argv) > 1 else ""
    modules = [importlib.import_module(name) for name in MODULES]
    wanted = [tuple(name for name in m.IDS if name.startswith(prefix)) for m in modules]
    if not any(wanted):
        known = ", ".join(name for module in modules for name in module.IDS)
        print(f"bench: no row begins with {prefix!r}: choose from {known}.", file=sys.stderr)
        raise SystemExit(2)
    measured = [row for m, ids in zip(modules, wanted, strict=True) for row in m.rows(ids)]

    table = Table("id", "value", "unit", "baseline", "ratio", "note")
    for row in measured:
        numbers = f"{row.value:,.0f}", row.unit, f"{row.baseline:,.0f}", f"{row.ratio:.2f}"
        table.add_row(row.id, *numbers, row.note)
    Console(width=140).print(table)
    Path("build").mkdir(exist_ok=True)
    content = {"rows": [dataclasses.asdict(row) for row in measured]}
    Path("build/bench.json").write_text(json.dumps(content, indent=2) + "\n")


if __name__ == "__main__":
    main()
