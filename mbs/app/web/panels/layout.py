"""The two sides of a panel: what is asked for at the left, the answer at the right."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from nicegui import ui

from mbs.app.web.app import App
from mbs.app.web.document.document import Document


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
    ui.label(sentence).classes("app-note")


_CHANGED = "The robot has changed since this was made."
_ANSWER = 2
"""Elements that an answer has at least; a note that waits for one is alone."""


@contextmanager
def new_answer(app: App, shown: ui.element, document: Document) -> Iterator[None]:
    """The place of an answer, the old one taken away.

    Args:
        app: of the page.
        shown: where the answer is.
        document: the robot that it is of; where another one stands there by now, it says so.
    """
    shown.clear()
    with shown:
        if document != app.document:
            _note_of_change()
        yield


@dataclass(frozen=True, slots=True)
class Asking:
    """A button that asks for an answer, where it is shown, and how.

    Attributes:
        app: of the page.
        button: it is off while the answer is made.
        shown: where the answer is.
        show: puts an answer where the slot is.
    """

    app: App
    button: ui.button
    shown: ui.element
    show: Callable[[Any], None]

    async def run(self, label: str, task: Callable[..., Any], *args: Any) -> None:
        """Show what `task(system, *args)` returns; see `App.run`."""
        document = self.app.document
        self.button.disable()
        try:
            made = await self.app.run(label, task, *args)
        finally:
            if not self.button.is_deleted:
                self.button.enable()
        if made is not None and not self.shown.is_deleted:
            with new_answer(self.app, self.shown, document):
                self.show(made)


def tell_of_changes(app: App, shown: ui.element) -> None:
    """Write above an answer that the robot has changed since, once it has.

    Args:
        app: of the page.
        shown: where the answer is; it is cleared before a new one.
    """

    def changed() -> None:
        if shown.is_deleted or len(shown.default_slot.children) < _ANSWER:
            return
        first = shown.default_slot.children[0]
        if not (isinstance(first, ui.label) and first.text == _CHANGED):
            with shown:
                _note_of_change().move(target_index=0)

    app.on_robot(changed)


def _note_of_change() -> ui.label:
    return ui.label(_CHANGED).classes("app-bad")
