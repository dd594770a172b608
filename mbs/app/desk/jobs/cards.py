"""Cards of running jobs: what is done, how far it is, and a button that stops it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from nicegui import ui


class JobCard:
    """One running job."""

    def __init__(self, label: str) -> None:
        with ui.element("div").classes("desk-job") as self.element:
            with ui.element("div").classes("desk-job-head"):
                self._label = ui.label(label)
                self._button = ui.button("Cancel").props("flat dense no-caps color=negative")
            self._bar = ui.linear_progress(show_value=False, size="5px").props("indeterminate")
            self._note = ui.label("starting").classes("desk-note")

    def on_cancel(self, cancel: Callable[[], Any]) -> None:
        """What the button does."""

        def stop() -> None:
            self._button.disable()
            self._note.set_text("stopping")
            cancel()

        self._button.on_click(stop)

    def progress(self, label: str, part: float) -> None:
        """Show what is running and the part of it that is done, 0 to 1."""
        self._bar.props(remove="indeterminate")
        self._bar.set_value(part)
        self._note.set_text(f"{label}: {100 * part:.0f} %")


class JobCards:
    """The corner of the page where the cards are."""

    def __init__(self) -> None:
        self._corner: ui.element | None = None

    def build(self) -> None:
        """Make the empty corner."""
        self._corner = ui.element("div").classes("desk-jobs")

    @contextmanager
    def card(self, label: str) -> Iterator[JobCard]:
        """A card for as long as the block lasts."""
        assert self._corner is not None, "build comes first"
        with self._corner:
            card = JobCard(label)
        try:
            yield card
        finally:
            if not card.element.is_deleted:
                card.element.delete()
