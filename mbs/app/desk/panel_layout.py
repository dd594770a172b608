"""The two sides of a panel: what is asked for at the left, the answer at the right."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nicegui import ui

from mbs.app.desk.desk import Desk


def two_sides(width: str = "330px") -> tuple[ui.element, ui.element]:
    """Two columns where the slot is; the right one takes the room that is left.

    Args:
        width: of the left one.
    """
    with ui.element("div").style("display: flex; gap: 22px; align-items: start; width: 100%"):
        left = ui.element("div").style(
            f"flex: 0 0 {width}; display: flex; flex-direction: column; gap: 10px"
        )
        right = ui.element("div").style(
            "flex: 1 1 0; min-width: 0; display: flex; flex-direction: column; gap: 8px"
        )
    return left, right


def in_a_row() -> ui.element:
    """Elements beside each other, on one middle line."""
    return ui.element("div").style(
        "display: flex; flex-wrap: wrap; gap: 6px 12px; align-items: center; width: 100%"
    )


def main_button(title: str, act: Callable[[], Any] | None = None) -> ui.button:
    """The button that makes the answer."""
    button = ui.button(title, on_click=act).props("unelevated no-caps dense")
    return button.style("padding: 3px 18px").mark(title.lower())


def side_button(title: str, act: Callable[[], Any], words: str = "") -> ui.button:
    """A button for something else, explained by a tooltip."""
    button = ui.button(title, on_click=act).props("flat no-caps dense")
    return button.tooltip(words) if words else button


def waiting_note(sentence: str) -> None:
    """What stands at the right before there is an answer."""
    ui.label(sentence).classes("desk-note")


def tell_of_changes(desk: Desk, shown: ui.element) -> None:
    """Write above an answer that the robot has changed since, once it has.

    Args:
        desk: of the page.
        shown: where the answer is; it is cleared before a new one.
    """
    notes = list[ui.label]()

    def changed() -> None:
        if shown.is_deleted or not shown.default_slot.children:
            return
        if notes and not notes[-1].is_deleted:
            return
        with shown:
            note = ui.label("The robot has changed since this was made.").classes("desk-bad")
        note.move(target_index=0)
        notes.append(note)

    desk.on_robot(changed)
