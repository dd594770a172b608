"""Source text as a panel shows it, with buttons to copy and to download it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from nicegui import ui

from mbs.app.web.app import App
from mbs.app.web.panels.layout import in_a_row
from mbs.operations import Count, Step

_LONGEST = 200_000
"""Characters that are shown; all of them are copied and downloaded."""


def text_view(app: App, text: str, file_name: str, height: str = "420px") -> None:
    """Text in a box that scrolls, with its buttons.

    Args:
        app: of the page.
        text: to show.
        file_name: for the download.
        height: of the box at most.
    """
    text_buttons(app, text, file_name)
    shown = text
    if len(text) > _LONGEST:
        shown = f"{text[:_LONGEST]}\n... {len(text) - _LONGEST} characters more in the download"
    ui.label(shown).classes("app-code").style(f"max-height: {height}").mark("code")


def text_buttons(app: App, text: str, file_name: str) -> None:
    """Buttons that copy a text and download it as a file."""

    def copy() -> None:
        ui.clipboard.write(text)
        app.tell(f"{_lines(text)} copied")

    with in_a_row():
        ui.button("Copy", icon="content_copy", on_click=copy).props("flat dense no-caps").mark(
            "copy"
        )
        ui.button(
            "Download",
            icon="download",
            on_click=lambda: app.download(text.encode(), file_name),
        ).props("flat dense no-caps").tooltip(file_name).mark("download")
        ui.label(f"{file_name}, {_lines(text)}").classes("app-note")


def _lines(text: str) -> str:
    count = len(text.splitlines())
    return f"{count} line{'s' if count != 1 else ''}"


# Numbers of operations as a small table.


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
    table.props("dense flat bordered hide-bottom").classes("app-table")
    return table


def column(name: str, label: str, align: str = "right") -> dict[str, Any]:
    """A column of a table, as Quasar takes it.

    Args:
        name: of the field in the rows.
        label: above it.
        align: "left" or "right".
    """
    return {"name": name, "label": label, "field": name, "align": align}
