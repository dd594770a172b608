"""Which passes of the optimizer a visitor wants."""

from __future__ import annotations

from typing import Any, cast

from nicegui import ui

from mbs.app.desk.session import Session
from mbs.app.tasks.equations import EVERY_PASS

_NOTE = "optimizer"


def passes_of(session: Session) -> tuple[str, ...]:
    """The passes that equations are written after, in the order in which they are made."""
    settings = optimizer_settings(session)
    return tuple(p for p in EVERY_PASS if p in settings["passes"]) if settings["on"] else ()


def optimizer_settings(session: Session) -> dict[str, Any]:
    """Whether the optimizer is on, "on", and the names of its passes, "passes"; both may be set."""
    found = session.notes.setdefault(_NOTE, {"on": True, "passes": list(EVERY_PASS)})
    return cast(dict[str, Any], found)


def optimizer_switch(session: Session, title: str) -> ui.checkbox:
    """A box that turns the optimizer on and off."""
    settings = optimizer_settings(session)

    def changed() -> None:
        settings["on"] = bool(box.value)

    box = ui.checkbox(title, value=settings["on"], on_change=changed).props("dense")
    return box
