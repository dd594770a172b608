"""What a reader of a file did that its author may not expect."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

NoteKind = Literal["renamed", "ignored", "doubted", "completed"]


@dataclass(frozen=True, slots=True)
class Note:
    """One element of a file that was not taken as it is written.

    Attributes:
        kind: "renamed", its name is another one here; "ignored", it has no meaning here;
            "doubted", it was taken, and no real mechanism has it; "completed", something that the
            format requires was missing.
        element: such as "link 'base'".
        text: the rest of the sentence: what is written there, and what was made of it.
        line: of the file; None where the format's own reader does not report it.
    """

    kind: NoteKind
    element: str
    text: str
    line: int | None = None

    def __str__(self) -> str:
        line = "" if self.line is None else f"line {self.line}: "
        return f"{line}{self.element}: {self.text}"
