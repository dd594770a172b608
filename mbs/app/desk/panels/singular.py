"""The panel of singular configurations: the determinant of a Jacobian in factors."""

from __future__ import annotations

from functools import partial
from typing import cast

from nicegui import ui

from mbs.app.desk.desk import Desk
from mbs.app.desk.panels.equations import open_equations
from mbs.app.desk.panels.form import Given, OptionForm
from mbs.app.desk.panels.layout import (
    Asking,
    in_a_row,
    main_button,
    side_button,
    tell_of_changes,
    two_sides,
    waiting_note,
)
from mbs.app.desk.panels.text_view import text_view
from mbs.app.tasks.equations import entry
from mbs.app.tasks.singular import DeterminantFactor, Singular, singular

KEY = "determinant"


async def open_singular(desk: Desk) -> None:
    """Open the panel and factor the determinant with the options of last time.

    Args:
        desk: of the page.
    """
    one = entry(KEY)
    given = cast(Given, desk.session.notes.setdefault(f"options {KEY}", {}))
    if desk.checked_system() is None:
        return
    with desk.open("Determinant and singular configurations", key=KEY):
        left, shown = two_sides()
    with left:
        form = OptionForm(desk, one, given)
        with in_a_row():
            button = main_button("DeterminantFactor")
            act = partial(open_equations, desk, KEY, "c")
            side_button("Equations", act, "The determinant as a function, in any language")
    with shown:
        waiting_note("The factors appear here.")

    tell_of_changes(desk, shown)

    async def factor() -> None:
        asking = Asking(desk, button, shown, partial(_show, desk))
        await asking.run("Factoring the determinant", singular, form.given, desk.q)

    button.on_click(factor)
    await form.fill()
    await factor()


def _show(desk: Desk, made: Singular) -> None:
    ui.label(made.verdict).style("font-weight: 600").mark("verdict")
    rows, columns = ", ".join(made.rows), ", ".join(made.columns)
    ui.label(
        f"{made.system}, frame {made.frame}: rows {rows}; columns {columns}. S23 is sin(q2 + q3)."
    ).classes("desk-note")
    text_view(desk, made.determinant + "\n", f"{made.system}_determinant.txt", "120px")
    for number, one in enumerate(made.factors, 1):
        _factor(desk, number, one)


def _factor(desk: Desk, number: int, one: DeterminantFactor) -> None:
    with in_a_row():
        show = ui.button("Show").props("flat no-caps dense").mark(f"show {number}")
        if one.configuration is None:
            show.disable()
            show.tooltip("No configuration near the present one makes it zero")
        else:
            show.on_click(partial(desk.set_configuration, one.configuration))
            show.tooltip(f"Move the picture there; the determinant is {one.determinant:.1e}")
        ui.label(one.text).style("font-family: var(--d-mono)")
        ui.label(f"zero where {one.condition}").classes("desk-note")
