"""Notes on the changes that a reader of a file made to its content."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

NoteKind = Literal["renamed", "ignored", "doubted", "completed"]


@dataclass(frozen=True, slots=True)
class ImportNote:
    """A note on one element of a file that was changed, ignored, completed or kept with doubt.

    Attributes:
        kind: "renamed": the element has another name in the mechanism. "ignored": it has no meaning
            in a mechanism. "doubted": it was kept, but is not physically plausible. "completed": a
            part that the format requires was missing and has been added.
        element: description of the element, such as "link 'base'".
        text: rest of the message: the content in the file and its interpretation.
        line: line in the file. None if the parser of the format reports none.
    """

    kind: NoteKind
    element: str
    text: str
    line: int | None = None

    def __str__(self) -> str:
        line = "" if self.line is None else f"line {self.line}: "
        return f"{line}{self.element}: {self.text}"
