"""Numbers of operations as a small table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from nicegui import ui

from mbs.operations import Count, Step

_KINDS = {
    "mul": "multiplications",
    "add": "additions",
    "div": "divisions",
    "sqrt": "roots",
    "trig": "sines and cosines",
    "other": "others",
    "total": "together",
}

BEFORE = (
    "Before: the model as its recursion made it, constants folded and equal parts computed once."
)
"""What the operations before the optimizer are those of."""


def count_table(counts: Mapping[str, Count]) -> None:
    """A column for each count, under its title.

    Args:
        counts: numbers by what they are of, such as "before".
    """
    columns = [column("kind", "operations", "left")]
    columns += [column(title, title) for title in counts]
    rows = [
        {"kind": words, **{title: getattr(count, kind) for title, count in counts.items()}}
        for kind, words in _KINDS.items()
    ]
    once = {
        title: count.parameter_only.total if count.parameter_only else 0
        for title, count in counts.items()
    }
    rows.append({"kind": "on parameters alone, once", **once})
    plain_table(columns, rows, "kind").mark("counts")


def steps_table(steps: Sequence[Step]) -> None:
    """The passes of the optimizer, in the order in which they were made."""
    columns = [
        column("name", "pass", "left"),
        column("before", "before"),
        column("after", "after"),
        column("seconds", "s"),
    ]
    rows = [
        {
            "key": number,
            "name": step.name,
            "before": str(step.before),
            "after": str(step.after) if step.kept else f"{step.after} undone",
            "seconds": f"{step.seconds:.2f}",
        }
        for number, step in enumerate(steps)
    ]
    plain_table(columns, rows, "key")


def plain_table(
    columns: Sequence[dict[str, Any]], rows: Sequence[dict[str, Any]], key: str
) -> ui.table:
    """A dense table without frills.

    Args:
        columns: see `column`.
        rows: values by the names of columns.
        key: field that tells rows apart.
    """
    table = ui.table(columns=list(columns), rows=list(rows), row_key=key)
    table.props("dense flat bordered hide-bottom").classes("desk-table")
    return table


def column(name: str, label: str, align: str = "right") -> dict[str, Any]:
    """A column of a table, as Quasar takes it.

    Args:
        name: of the field in the rows.
        label: above it.
        align: "left" or "right".
    """
    return {"name": name, "label": label, "field": name, "align": align}
