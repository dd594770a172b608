"""Source text as a panel shows it, with buttons to copy and to download it."""

from __future__ import annotations

from nicegui import ui

from mbs.app.desk.desk import Desk
from mbs.app.desk.panels.layout import in_a_row

_LONGEST = 200_000
"""Characters that are shown; all of them are copied and downloaded."""


def text_view(desk: Desk, text: str, file_name: str, height: str = "420px") -> None:
    """Text in a box that scrolls, with its buttons.

    Args:
        desk: of the page.
        text: to show.
        file_name: for the download.
        height: of the box at most.
    """
    text_buttons(desk, text, file_name)
    shown = text
    if len(text) > _LONGEST:
        shown = f"{text[:_LONGEST]}\n... {len(text) - _LONGEST} characters more in the download"
    ui.label(shown).classes("desk-code").style(f"max-height: {height}").mark("code")


def text_buttons(desk: Desk, text: str, file_name: str) -> None:
    """Buttons that copy a text and download it as a file."""

    def copy() -> None:
        ui.clipboard.write(text)
        desk.tell(f"{_lines(text)} copied")

    with in_a_row():
        ui.button("Copy", icon="content_copy", on_click=copy).props("flat dense no-caps").mark(
            "copy"
        )
        ui.button(
            "Download",
            icon="download",
            on_click=lambda: desk.download(text.encode(), file_name),
        ).props("flat dense no-caps").tooltip(file_name).mark("download")
        ui.label(f"{file_name}, {_lines(text)}").classes("desk-note")


def _lines(text: str) -> str:
    count = len(text.splitlines())
    return f"{count} line{'s' if count != 1 else ''}"
