"""`mbs count`: operation counts of models."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mbs.app.cli import completion
from mbs.app.cli.arguments import Gravity, Json, Mount, Parameters, Robot, examples
from mbs.app.cli.loading import system
from mbs.app.cli.model import Options, count_data
from mbs.app.cli.printing import PrintedTable, note, print_json, print_tables
from mbs.errors import ModelError

if TYPE_CHECKING:
    from mbs.app.tasks.equations import CountRow
    from mbs.assembly import System
    from mbs.operations import Count

EXAMPLES = examples(
    "mbs count puma560",
    "mbs count puma560 --all --no-optimise",
    "mbs count puma560 idm ddm",
    "mbs count rx90 jacobian --option expressed_in=3",
    "mbs count sr400 idm --json",
)
_KINDS = ("mul", "add", "div", "sqrt", "trig", "other")
_COLUMNS = ("model", "*", "+", "/", "sqrt", "trig", "other", "parameters alone")
_USUAL = ("dgm", "jacobian", "idm", "lagrange", "inertia", "bias", "gravity", "ddm")


def count(
    robot: Robot,
    key: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="KEY",
            help="Models, as `mbs models` lists them; the usual ones when left out.",
            autocompletion=completion.keys,
            show_default=False,
        ),
    ] = None,
    *,
    every: Annotated[
        bool, typer.Option("--all", help="Count every model that the robot has.")
    ] = False,
    optimise: Annotated[
        bool,
        typer.Option(
            "--optimise/--no-optimise",
            help="Whether to count what is left after the optimizer too.",
        ),
    ] = True,
    option: Options = None,
    parameter: Parameters = None,
    gravity: Gravity = "",
    mount: Mount = None,
    json: Json = False,
) -> None:
    """Count the operations of models, before and after the optimizer.

    As in the literature, signs are not counted, a product by 2 is an addition, and operations on
    parameters alone are counted separately.
    """
    from mbs.app.tasks.equations import EVERY_PASS, counts
    from mbs.app.tasks.laws import assignments

    assembled = system(robot, parameter, gravity, mount)
    options = assignments(option or (), "--option")
    keys = key or _offer(assembled, every)
    counted = counts(assembled, keys, EVERY_PASS if optimise else (), options)
    rows = _with_numbers(counted)
    if json:
        print_json([_data(row, optimise) for row in rows])
        return
    print_tables(_tables(assembled.name, rows, optimise))


def _offer(system: System, every: bool) -> list[str]:
    """Return the keys of the models of the robot: the usual models, or every model."""
    from mbs.app.tasks.equations import entries

    having = [e.key for e in entries() if not e.refusal(system) and e.has_function(system)]
    return [name for name in having if every or name in _USUAL]


def _with_numbers(rows: Sequence[CountRow]) -> list[CountRow]:
    """Return the rows that have counts; print why other rows have none, on standard error.

    Raises:
        ModelError: no row has counts.
    """
    counted = [row for row in rows if row.before is not None]
    reasons = [row.reason for row in rows if row.before is None]
    if reasons and not counted:
        raise ModelError(reasons[0])
    for reason in reasons:
        note(f"mbs: {reason}")
    return counted


def _data(row: CountRow, optimise: bool) -> dict[str, Any]:
    """Return the counts of a model as data for JSON; `optimise` adds the optimized counts."""
    after = count_data(row.after) if optimise else None
    return {"key": row.key, "title": row.title, "before": count_data(row.before), "after": after}


def _tables(name: str, rows: Sequence[CountRow], optimise: bool) -> list[PrintedTable]:
    """Return the tables of counts of the robot `name`: as built, and after the optimizer.

    The second table requires `optimise`.
    """
    before = [_cells(row.key, row.before) for row in rows]
    tables = [PrintedTable(f"{name}, as built", _COLUMNS, before, _COLUMNS[1:])]
    if optimise:
        after = [_cells(row.key, row.after) for row in rows]
        tables.append(PrintedTable(f"{name}, after the optimizer", _COLUMNS, after, _COLUMNS[1:]))
    return tables


def _cells(key: str, count: Count | None) -> list[str]:
    """Return the row of a table for the model `key`: its counts by kind of operation."""
    numbers = count_data(count) or {}
    once = numbers["parameter_only"]["total"]
    return [key, *(str(numbers[kind]) for kind in _KINDS), str(once)]
