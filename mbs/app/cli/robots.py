"""`mbs robots`: list of the catalogue."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mbs.app.cli.arguments import Json, examples
from mbs.app.cli.printing import PrintedTable, print_json, print_tables
from mbs.app.cli.structure import structure

if TYPE_CHECKING:
    from mbs.mechanism import Mechanism

EXAMPLES = examples(
    "mbs robots",
    "mbs robots --mobility",
    "mbs robots --json | jq -r '.[] | select(.kind == \"closed\").name'",
)


def robots(
    *,
    mobility: Annotated[
        bool,
        typer.Option(
            "--mobility", help="Count independent motions too: assembles all, which takes seconds."
        ),
    ] = False,
    json: Json = False,
) -> None:
    """List the robots of the catalogue.

    Joints are the moving joints, with their total degrees of freedom. Loops are closed loops and
    couplings of coordinates.
    """
    from mbs.robots import catalogue

    rows = structure_rows(catalogue())
    if mobility:
        rows = _with_mobility(rows, catalogue())
    if json:
        print_json(rows)
        return
    columns = [name for name in rows[0] if name != "source"]
    cells = [[str(row[name]) for name in columns] + [row["source"]] for row in rows]
    counts = ("joints", "dofs", "loops", "mobility")
    print_tables([PrintedTable("", (*columns, "source"), cells, counts, cut=True)])


def structure_rows(robots: Mapping[str, Callable[[], Mechanism]]) -> list[dict[str, Any]]:
    """Return name, kind, counts and source of robots from their descriptions, without assembly.

    Args:
        robots: functions that build the robots, by name.
    """
    built = {name: build() for name, build in robots.items()}
    return [{"name": n, **asdict(structure(m)), "source": m.source} for n, m in built.items()]


def _with_mobility(
    rows: list[dict[str, Any]], robots: Mapping[str, Callable[[], Mechanism]]
) -> list[dict[str, Any]]:
    """Return the rows with the number of independent velocities as "mobility", after assembly."""
    from mbs.progress import progress

    counted = []
    with progress("assembling the catalogue", 0.0, len(rows)) as reached:
        for done, row in enumerate(rows, start=1):
            system = robots[row["name"]]().assemble()
            counted.append({**row, "mobility": len(system.independent)})
            reached(float(done))
    return counted
