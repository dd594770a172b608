"""What people read and see of an FMU beside its variables."""

from __future__ import annotations

from dataclasses import dataclass

from mbs.view.drawing import Drawing


@dataclass(frozen=True, slots=True)
class PageTable:
    """A table of the documentation.

    Attributes:
        title: what it shows.
        columns: heads of the columns.
        rows: a text for each column.
        note: a sentence below the title.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


@dataclass(frozen=True, slots=True)
class About:
    """What the documentation shows beside text and variables.

    Attributes:
        tables: in the order of the page.
        drawing: of it at the start posture, or None; the icon is made of it too.
    """

    tables: tuple[PageTable, ...] = ()
    drawing: Drawing | None = None
