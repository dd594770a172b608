"""The panel of base inertial parameters: a table, to copy and to download."""

from __future__ import annotations

from functools import partial
from typing import cast

from nicegui import ui

from mbs.app.tasks.base import BaseTable, base
from mbs.app.tasks.equations import entry
from mbs.app.web.app import App
from mbs.app.web.panels.equations import open_equations
from mbs.app.web.panels.form import Given, OptionForm
from mbs.app.web.panels.layout import (
    Asking,
    in_a_row,
    main_button,
    side_button,
    tell_of_changes,
    two_sides,
    waiting_note,
)
from mbs.app.web.panels.text_view import column, plain_table, text_buttons

KEY = "base-parameters"

_BASE_COLUMNS = (
    ("name", "parameter", "left"),
    ("unit", "unit", "left"),
    ("value", "value", "right"),
    ("expression", "what is in it", "left"),
)


async def open_base(app: App) -> None:
    """Open the panel and find the base parameters of the present robot.

    Args:
        app: of the page.
    """
    one = entry(KEY)
    given = cast(Given, app.session.notes.setdefault(f"options {KEY}", {}))
    if app.checked_system() is None:
        return
    with app.open(one.title, key=KEY):
        left, shown = two_sides("240px")
    with left:
        form = OptionForm(app, one, given)
        with in_a_row():
            button = main_button("Find")
            side_button("As text", partial(open_equations, app, KEY), "In words, or in a language")
    with shown:
        waiting_note("The table appears here.")

    tell_of_changes(app, shown)

    async def find() -> None:
        options = form.given
        method = options.pop("method", "symbolic")
        asking = Asking(app, button, shown, partial(_show, app))
        await asking.run("Finding base parameters", base, method, options)

    button.on_click(find)
    await form.fill()
    await find()


def _show(app: App, made: BaseTable) -> None:
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
