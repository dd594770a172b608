"""`mbs models`: list of the available models by menu."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mbs.app.cli import completion
from mbs.app.cli.arguments import Json, Parameters, examples
from mbs.app.cli.loading import system
from mbs.app.cli.printing import PrintedTable, plain, print_json, print_tables

if TYPE_CHECKING:
    from mbs.assembly import System
    from mbs.models.catalogue import Entry

EXAMPLES = examples("mbs models", "mbs models sr400", "mbs models rx90 --json | jq '.[].key'")


def models(
    robot: Annotated[
        str | None,
        typer.Argument(
            metavar="ROBOT",
            help="List what this robot has, with the values of the options.",
            autocompletion=completion.robots,
            show_default=False,
        ),
    ] = None,
    *,
    parameter: Parameters = None,
    json: Json = False,
) -> None:
    """List the keys of models by menu; with ROBOT, only the models that it has.

    `mbs model` takes the options of a model as --option NAME=VALUE.
    """
    from mbs.app.tasks.equations import entries

    if robot is None:
        rows = [_row(entry) for entry in entries()]
    else:
        assembled = system(robot, parameter)
        rows = [_row_of(assembled, e) for e in entries() if not e.refusal(assembled)]
    if json:
        print_json(rows)
        return
    print_tables(_tables(rows))


def _row(entry: Entry) -> dict[str, Any]:
    """Return a model of the catalogue as a dict of its key, title, menu and options."""
    return {
        "menu": entry.menu,
        "key": entry.key,
        "title": entry.title,
        "symbol": entry.symbol,
        "structures": entry.structures,
        "options": [option.name for option in entry.options],
    }


def _row_of(system: System, entry: Entry) -> dict[str, Any]:
    """Return a model as `_row`, with values and defaults of its options for a robot."""
    from mbs.app.tasks.equations import option_values

    options = [
        {
            "name": option.name,
            "title": option.title,
            "kind": option.kind,
            "values": plain(option.values),
            "default": plain(option.chosen),
        }
        for option in option_values(system, entry)
    ]
    return {**_row(entry), "options": options}


def _tables(rows: Sequence[dict[str, Any]]) -> list[PrintedTable]:
    """Return one table of models per menu."""
    menus = dict.fromkeys(row["menu"] for row in rows)
    return [
        PrintedTable(
            menu,
            ("key", "model", "formula", "robots", "options"),
            [
                (row["key"], row["title"], row["symbol"], row["structures"], _options(row))
                for row in rows
                if row["menu"] == menu
            ],
            soft=("model", "options"),
        )
        for menu in menus
    ]


def _options(row: dict[str, Any]) -> str:
    """Return the options of a row as text, separated by commas."""
    return ", ".join(_option_text(option) for option in row["options"])


def _option_text(option: Any) -> str:
    """Return an option as text: its name, or NAME=DEFAULT if its values are known."""
    if isinstance(option, str):
        return option
    default = option["default"]
    if isinstance(default, list):
        default = ",".join(map(str, default))
    return f"{option['name']}={'' if default is None else default}"
