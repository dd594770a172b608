"""The panel of base inertial parameters: a table, to copy and to download."""

from __future__ import annotations

from typing import Any

from nicegui import ui

from mbs.app.tasks.base import BaseTable, base
from mbs.app.web.app import App
from mbs.app.web.panels.one_answer import PanelTexts, open_one_answer
from mbs.app.web.panels.text_view import column, plain_table, text_buttons

KEY = "base-parameters"

_TEXTS = PanelTexts(
    button="Find",
    waiting="The table appears here.",
    label="Finding base parameters",
    equations="As text",
    explanation="In words, or in a language",
)
_BASE_COLUMNS = (
    ("name", "parameter", "left"),
    ("unit", "unit", "left"),
    ("value", "value", "right"),
    ("expression", "what is in it", "left"),
)


async def open_base(app: App) -> None:
    """Open the panel of base parameters and compute them for the present robot.

    Args:
        app: app of the page.
    """

    def arguments(options: dict[str, Any]) -> tuple[Any, ...]:
        return options.pop("method", "symbolic"), options

    await open_one_answer(app, KEY, _TEXTS, base, arguments, show=_show, width="240px")


def _show(app: App, made: BaseTable) -> None:
    """Show the table of base parameters at the present position of the page."""
    ui.label(
        f"{made.system}: {len(made.rows)} base parameters of {made.total}, {made.method}"
    ).style("font-weight: 600").mark("found")
    ui.label(made.check + ".").classes("app-note")
    text_buttons(app, made.csv(), f"{made.system}_base_parameters.csv")
    columns = [column(*one) for one in _BASE_COLUMNS]
    rows = [
        {
            "name": row.name,
            "unit": row.unit,
            "value": "" if row.value is None else f"{row.value:.6g}",
            "expression": row.expression,
        }
        for row in made.rows
    ]
    table = plain_table(columns, rows, "name")
    table.props("wrap-cells").mark("base")
    ui.label(f"Grouped with others: {', '.join(made.grouped) or 'none'}.").classes("app-note")
    ui.label(f"Without effect: {', '.join(made.without_effect) or 'none'}.").classes("app-note")
