"""`detpg list`: what there is."""

import dataclasses
from typing import Any

from detpg.cli.json_output import print_json


@dataclasses.dataclass(frozen=True)
class List:
    """Lists environments, algorithms with their equations, and studies."""

    json: bool = False
    """Print JSON instead of tables."""

    def run(self) -> None:
        """Prints the registries."""
        found = contents()
        if self.json:
            print_json(found)
        else:
            _print_tables(found)


def contents() -> dict[str, list[dict[str, Any]]]:
    """The registries as JSON types."""
    from detpg.algorithms import ALGORITHMS
    from detpg.environments import ENVIRONMENTS
    from detpg.experiments import STUDIES
    from detpg.types import hyper_parameters

    return {
        "environments": [
            {"name": name, "summary": _first_line(environment)}
            for name, environment in ENVIRONMENTS.items()
        ],
        "algorithms": [
            {
                "name": name,
                "summary": _first_line(algorithm),
                "equations": algorithm.equations,
                "hyper_parameters": {
                    key: {"doc": known.doc, "default": known.default}
                    for key, known in hyper_parameters(algorithm).items()
                },
            }
            for name, algorithm in ALGORITHMS.items()
        ],
        "studies": [
            {
                "name": name,
                "summary": study.title,
                "section": study.section,
                "presets": list(study.presets),
            }
            for name, study in STUDIES.items()
        ],
    }


def _first_line(documented: Any) -> str:
    return (documented.__doc__ or "").strip().splitlines()[0]


def _print_tables(found: dict[str, list[dict[str, Any]]]) -> None:
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    console = Console()
    for kind, rows in found.items():
        columns = [column for column in rows[0] if column != "hyper_parameters"]
        table = Table(*columns, title=kind, title_justify="left")
        for row in rows:
            cells = (row[column] for column in columns)
            texts = (", ".join(c) if isinstance(c, list) else c for c in cells)
            table.add_row(*(escape(text) for text in texts))
        console.print(table)
