"""Panel of singular configurations: the determinant of a Jacobian in factors."""

from __future__ import annotations

from functools import partial
from typing import Any

from nicegui import ui

from mbs.app.tasks.singular import DeterminantFactor, Singular, singular
from mbs.app.web.app import App
from mbs.app.web.panels.layout import in_a_row
from mbs.app.web.panels.one_answer import PanelTexts, open_one_answer
from mbs.app.web.panels.text_view import text_view

KEY = "determinant"

_TITLE = "Determinant and singular configurations"
_TEXTS = PanelTexts(
    button="Factor",
    waiting="The factors appear here.",
    label="Factoring the determinant",
    equations="Equations",
    explanation="The determinant as a function, in any language",
)


async def open_singular(app: App) -> None:
    """Open the panel of singular configurations and factor the determinant.

    The form shows the options that were chosen last.

    Args:
        app: app of the page.
    """

    def arguments(options: dict[str, Any]) -> tuple[Any, ...]:
        return options, app.q

    await open_one_answer(
        app, KEY, _TEXTS, singular, arguments, show=_show, title=_TITLE, language="c"
    )


def _show(app: App, made: Singular) -> None:
    """Show the determinant and its factors at the present position of the page."""
    ui.label(made.verdict).style("font-weight: 600").mark("verdict")
    rows, columns = ", ".join(made.rows), ", ".join(made.columns)
    ui.label(
        f"{made.system}, frame {made.frame}: rows {rows}; columns {columns}. S23 is sin(q2 + q3)."
    ).classes("app-note")
    text_view(app, made.determinant + "\n", f"{made.system}_determinant.txt", "120px")
    for number, one in enumerate(made.factors, 1):
        _factor(app, number, one)


def _factor(app: App, number: int, one: DeterminantFactor) -> None:
    """Show factor `number` of the determinant with a button that moves the picture to its zero."""
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
