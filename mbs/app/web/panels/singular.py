"""The panel of singular configurations: the determinant of a Jacobian in factors."""

from __future__ import annotations

from functools import partial
from typing import cast

from nicegui import ui

from mbs.app.tasks.equations import entry
from mbs.app.tasks.singular import DeterminantFactor, Singular, singular
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
from mbs.app.web.panels.text_view import text_view

KEY = "determinant"


async def open_singular(app: App) -> None:
    """Open the panel and factor the determinant with the options of last time.

    Args:
        app: of the page.
    """
    one = entry(KEY)
    given = cast(Given, app.session.notes.setdefault(f"options {KEY}", {}))
    if app.checked_system() is None:
        return
    with app.open("Determinant and singular configurations", key=KEY):
        left, shown = two_sides()
    with left:
        form = OptionForm(app, one, given)
        with in_a_row():
            button = main_button("DeterminantFactor")
            act = partial(open_equations, app, KEY, "c")
            side_button("Equations", act, "The determinant as a function, in any language")
    with shown:
        waiting_note("The factors appear here.")

    tell_of_changes(app, shown)

    async def factor() -> None:
        asking = Asking(app, button, shown, partial(_show, app))
        await asking.run("Factoring the determinant", singular, form.given, app.q)

    button.on_click(factor)
    await form.fill()
    await factor()


def _show(app: App, made: Singular) -> None:
    ui.label(made.verdict).style("font-weight: 600").mark("verdict")
    rows, columns = ", ".join(made.rows), ", ".join(made.columns)
    ui.label(
        f"{made.system}, frame {made.frame}: rows {rows}; columns {columns}. S23 is sin(q2 + q3)."
    ).classes("app-note")
    text_view(app, made.determinant + "\n", f"{made.system}_determinant.txt", "120px")
    for number, one in enumerate(made.factors, 1):
        _factor(app, number, one)


def _factor(app: App, number: int, one: DeterminantFactor) -> None:
    with in_a_row():
        show = ui.button("Show").props("flat no-caps dense").mark(f"show {number}")
        if one.configuration is None:
            show.disable()
            show.tooltip("No configuration near the present one makes it zero")
        else:
            show.on_click(partial(app.set_configuration, one.configuration))
            show.tooltip(f"Move the picture there; the determinant is {one.determinant:.1e}")
        ui.label(one.text).style("font-family: var(--d-mono)")
        ui.label(f"zero where {one.condition}").classes("app-note")
