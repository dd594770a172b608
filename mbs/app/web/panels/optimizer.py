"""Panel of the optimizer: its passes, and the operations that they save in every model."""

from __future__ import annotations

from typing import Any, cast

from nicegui import ui

from mbs.app.tasks.equations import EVERY_PASS, CountRow, counts
from mbs.app.web.app import App
from mbs.app.web.panels.layout import (
    TaskButton,
    in_a_row,
    main_button,
    two_sides,
    waiting_note,
    warn_of_changes,
)
from mbs.app.web.panels.text_view import BEFORE, column, plain_table
from mbs.app.web.session import Session
from mbs.operations import PASSES, Count

# Passes of the optimizer that the user has chosen.


_NOTE = "optimizer"


def passes_of(session: Session) -> tuple[str, ...]:
    """Return the chosen passes in the order of application; empty if the optimizer is off.

    Args:
        session: session of the visitor.
    """
    settings = optimizer_settings(session)
    return tuple(p for p in EVERY_PASS if p in settings["passes"]) if settings["on"] else ()


def optimizer_settings(session: Session) -> dict[str, Any]:
    """Return the mutable settings of the optimizer.

    Args:
        session: session of the visitor.

    Returns:
        Dict of "on" (whether it is on) and "passes" (names of the chosen passes).
    """
    found = session.notes.setdefault(_NOTE, {"on": True, "passes": list(EVERY_PASS)})
    return cast(dict[str, Any], found)


def optimizer_switch(session: Session, title: str) -> ui.checkbox:
    """Create a checkbox that turns the optimizer on and off.

    Args:
        session: session of the visitor.
        title: label of the checkbox.
    """
    settings = optimizer_settings(session)

    def changed() -> None:
        settings["on"] = bool(box.value)

    box = ui.checkbox(title, value=settings["on"], on_change=changed).props("dense")
    return box


def open_optimizer(app: App) -> None:
    """Open the panel of the optimizer.

    Args:
        app: app of the page.
    """
    settings = optimizer_settings(app.session)
    with app.open("Optimizer", key="optimizer"):
        left, shown = two_sides("430px")
    with left:
        with in_a_row():
            button = main_button("Count every model").mark("count")
            optimizer_switch(app.session, "optimize the equations").mark("on")
        for one in PASSES:
            _pass(settings["passes"], one.name, one.meaning)
    with shown:
        waiting_note("What the passes save in every model appears here.")

    warn_of_changes(app, shown)

    async def count_all() -> None:
        task_button = TaskButton(app, button, shown, _show)
        await task_button.run("Counting operations", counts, (), passes_of(app.session))

    button.on_click(count_all)


def _pass(chosen: list[str], name: str, meaning: str) -> None:
    """Create the checkbox of a pass, which adds its name to `chosen` or removes it."""

    def changed() -> None:
        if name in chosen:
            chosen.remove(name)
        if box.value:
            chosen.append(name)

    with ui.element("div").style("display: flex; gap: 10px; align-items: center"):
        box = ui.checkbox(name, value=name in chosen, on_change=changed).props("dense")
        box.style("flex: 0 0 106px").mark(f"pass {name}")
        ui.label(meaning).classes("app-note")


def _show(made: tuple[CountRow, ...]) -> None:
    """Show the table of operation counts of all models."""
    heads = (
        ("title", "model", "left"),
        ("before", "before: mul/add", "right"),
        ("all_before", "together", "right"),
        ("after", "after: mul/add", "right"),
        ("all_after", "together", "right"),
        ("saved", "saved", "right"),
    )
    columns = [column(*head) for head in heads]
    rows = [
        _row(row, row.before, row.after)
        for row in made
        if row.before is not None and row.after is not None
    ]
    plain_table(columns, rows, "title").style("width: auto").mark("counts")
    ui.label(BEFORE).classes("app-note")
    for row in made:
        if row.reason:
            ui.label(row.reason).classes("app-note")


def _row(row: CountRow, before: Count, after: Count) -> dict[str, object]:
    """Return the row of a model with its operation counts before and after the optimizer."""
    saved = 100 * (1 - after.total / before.total) if before.total else 0
    return {
        "title": row.title,
        "before": str(before),
        "all_before": before.total,
        "after": str(after),
        "all_after": after.total,
        "saved": f"{saved:.0f} %",
    }
