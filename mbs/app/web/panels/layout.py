"""Layout of a panel in two columns: the inputs at the left, the result at the right."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from nicegui import ui

from mbs.app.web.app import App
from mbs.app.web.document.document import Document


def two_sides(width: str = "330px") -> tuple[ui.element, ui.element]:
    """Create two columns at the present position; the right one takes the remaining width.

    Args:
        width: width of the left column in CSS.

    Returns:
        The left and the right column.
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
    """Create a container for elements next to each other, vertically centred."""
    return ui.element("div").style(
        "display: flex; flex-wrap: wrap; gap: 6px 12px; align-items: center; width: 100%"
    )


def main_button(title: str, act: Callable[[], Any] | None = None) -> ui.button:
    """Create the button that computes the result.

    Args:
        title: text of the button.
        act: action of the button.
    """
    button = ui.button(title, on_click=act).props("unelevated no-caps dense")
    return button.style("padding: 3px 18px").mark(title.lower())


def side_button(title: str, act: Callable[[], Any], words: str = "") -> ui.button:
    """Create a secondary button.

    Args:
        title: text of the button.
        act: action of the button.
        words: tooltip.
    """
    button = ui.button(title, on_click=act).props("flat no-caps dense")
    return button.tooltip(words) if words else button


def waiting_note(sentence: str) -> None:
    """Show a note at the place of a result that does not exist yet.

    Args:
        sentence: note.
    """
    ui.label(sentence).classes("app-note")


_CHANGED = "The robot has changed since this was made."
_ANSWER = 2
"""Minimum number of elements of a result; a note without result is a single element."""


@contextmanager
def new_answer(app: App, shown: ui.element, document: Document) -> Iterator[None]:
    """Replace a result by the elements that the block creates.

    If the robot was changed since the computation, a note is shown above them.

    Args:
        app: app of the page.
        shown: container of the result; it is cleared.
        document: robot for which the result was computed.
    """
    shown.clear()
    with shown:
        if document != app.document:
            _note_of_change()
        yield


@dataclass(frozen=True, slots=True)
class TaskButton:
    """Computation of a result for a panel, with a button and a container for the result.

    Attributes:
        app: app of the page.
        button: button that starts the computation; it is disabled while the computation runs.
        shown: container of the result.
        show: callable that displays a result at the present position of the page.
    """

    app: App
    button: ui.button
    shown: ui.element
    show: Callable[[Any], None]

    async def run(self, label: str, task: Callable[..., Any], *args: Any) -> None:
        """Compute `task(system, *args)` and show its result.

        An error is shown as a notification; see `App.run`.

        Args:
            label: description of the task for the user.
            task: function of a module; its arguments and its result are plain data.
            *args: further arguments.
        """
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


def warn_of_changes(app: App, shown: ui.element) -> None:
    """Show a note above a result as soon as the robot changes.

    Args:
        app: app of the page.
        shown: container of the result; it is cleared before a new result.
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
    """Create the note that the robot has changed since the computation."""
    return ui.label(_CHANGED).classes("app-bad")
