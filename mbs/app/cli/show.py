"""`mbs show`: a robot as tables, and the report of its assembly."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import typer

from mbs.app.cli.arguments import Gravity, Json, Mount, Parameters, Robot, examples
from mbs.app.cli.description import DRIVE, GEOMETRY, TEN, description_data
from mbs.app.cli.loading import system
from mbs.app.cli.printing import PrintedTable, number, print_json, print_tables

EXAMPLES = examples(
    "mbs show puma560",
    "mbs show my_robot.toml --parameter L2=0.3",
    "mbs show four_bar --json | jq .loops",
)


def show(
    robot: Robot,
    *,
    parameter: Parameters = None,
    gravity: Gravity = "",
    mount: Mount = None,
    json: Json = False,
) -> None:
    """Show a robot: frames, inertial parameters, coordinates, loops, symbols and the report.

    Frames are given by Khalil's parameters. Inertial parameters are about the origins of these
    frames. Units are SI units and radians.
    """
    data = description_data(system(robot, parameter, gravity, mount))
    if json:
        print_json(data)
        return
    gravity = ", ".join(_cell(value) for value in data["gravity"])
    typer.echo(f"{data['name']}: gravity ({gravity}) m/s2")
    if data["source"]:
        typer.echo(f"Source: {data['source']}")
    typer.echo()
    print_tables(_tables(data))
    typer.echo(f"\n{data['report']}")


def _tables(data: dict[str, Any]) -> list[PrintedTable]:
    """Return the tables of a robot from `description_data`."""
    links = {row["number"]: row["name"] for row in data["links"]}
    inertia = [{**row, "name": links[row["link"]]} for row in data["inertia"]]
    drive = [name for name in DRIVE if any(row[name] != 0 for row in inertia)]
    return [
        _table("Frames", data["links"], ("number", "name", "antecedent", "motion", *GEOMETRY)),
        _table("Inertial parameters", inertia, ("link", "name", *TEN, *drive)),
        _table("Coordinates", data["coordinates"]),
        _table("Loops and couplings", data["loops"]),
        _table("Symbols", data["symbols"]),
    ]


def _table(title: str, rows: Sequence[dict[str, Any]], names: Sequence[str] = ()) -> PrintedTable:
    """Return a table of rows (dicts) with the columns `names`; by default all columns."""
    names = names or list(rows[0] if rows else ())
    right = [name for name in names if any(_is_number(row[name]) for row in rows)]
    return PrintedTable(title, names, [[_cell(row[name]) for name in names] for row in rows], right)


def _is_number(value: object) -> bool:
    """Whether a value is a number; booleans are not."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def _cell(value: Any) -> str:
    """Return a value as the text of a table cell."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return number(value)
    if isinstance(value, tuple | list):
        return ", ".join(map(_cell, value)) or "-"
    return str(value)
