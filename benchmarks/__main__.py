"""Runs the benchmarks, prints a table, writes build/bench.json."""

import dataclasses
import json
import os
import sys
from pathlib import Path

# As on the command line of detpg: one thread per process (docs/decisions/0008), nothing cached,
# so that compilation is measured.
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")


def main() -> None:
    """Runs every row whose id begins with the given prefix."""
    from rich.console import Console
    from rich.table import Table

    from benchmarks import figure1, kernels

    prefix = sys.argv[1] if len(sys.argv) > 1 else ""
    modules = (figure1, kernels)
    wanted = {m: tuple(name for name in m.ROWS if name.startswith(prefix)) for m in modules}
    if not any(wanted.values()):
        known = ", ".join(name for module in modules for name in module.ROWS)
        print(f"bench: no row begins with {prefix!r}: choose from {known}.")
        raise SystemExit(2)
    measured = [row for module, names in wanted.items() for row in module.rows(names)]

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
