"""Display of source text in a panel, with buttons to copy and to download it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from nicegui import ui

from mbs.app.web.app import App
from mbs.app.web.panels.layout import in_a_row
from mbs.operations import Count, Step

_LONGEST = 200_000
"""Maximum number of displayed characters; the complete text is copied and downloaded."""


def text_view(app: App, text: str, file_name: str, height: str = "420px") -> None:
    """Show text in a scrolling box, with buttons to copy and download it.

    Args:
        app: app of the page.
        text: text to show.
        file_name: name of the downloaded file.
        height: maximum height of the box.
    """
    text_buttons(app, text, file_name)
    shown = text
    if len(text) > _LONGEST:
        shown = f"{text[:_LONGEST]}\n... {len(text) - _LONGEST} characters more in the download"
    ui.label(shown).classes("app-code").style(f"max-height: {height}").mark("code")


def text_buttons(app: App, text: str, file_name: str) -> None:
    """Create buttons that copy a text and download it as a file.

    Args:
        app: app of the page.
        text: text.
        file_name: name of the downloaded file.
    """

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
    """Return the number of lines of a text, such as "3 lines"."""
    count = len(text.splitlines())
    return f"{count} line{'s' if count != 1 else ''}"


# Operation counts as a small table.


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
"""Explanation of the operation count before the optimizer."""


def count_table(counts: Mapping[str, Count]) -> None:
    """Show a table of operation counts, a column for each count.

    Args:
        counts: column title, such as "before", to the operation count.
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
    """Show a table of the passes of the optimizer with operation counts and times.

    Args:
        steps: passes in the order in which they were applied.
    """
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
    """Create a dense table at the present position.

    Args:
        columns: column definitions, see `column`.
        rows: values by the names of columns.
        key: field that identifies a row.
    """
    table = ui.table(columns=list(columns), rows=list(rows), row_key=key)
    table.props("dense flat bordered hide-bottom").classes("app-table")
    return table


def column(name: str, label: str, align: str = "right") -> dict[str, Any]:
    """Return a column definition of a Quasar table.

    Args:
        name: name of the field in the rows.
        label: title of the column.
        align: "left" or "right".
    """
    return {"name": name, "label": label, "field": name, "align": align}
