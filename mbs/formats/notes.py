"""The notes that a reader takes of a file; in strict reading each of them is an error."""

from __future__ import annotations

from dataclasses import dataclass, field

from mbs.components.notes import Note, NoteKind
from mbs.errors import DescriptionError


@dataclass(slots=True)
class Notes:
    """Collects the notes of one file.

    Attributes:
        path: of the file, as messages say it.
        strict: refuse the file where a note would be taken.
        lines: whether the lines are those of the file, and not of a text made from it.
        taken: the notes, in the order of the file as far as it is read in order.
    """

    path: str
    strict: bool = False
    lines: bool = True
    taken: list[Note] = field(default_factory=list)

    def add(self, kind: NoteKind, element: str, text: str, line: int | None = None) -> None:
        """Take a note.

        Args:
            kind: of the note.
            element: of the file, such as "link 'base'".
            text: what is written there, and what was made of it.
            line: of the file.

        Raises:
            DescriptionError: reading is strict.
        """
        note = Note(kind, element, text, line if self.lines else None)
        if self.strict:
            raise DescriptionError(f"{self.path}: {note}; correct the file or read it not strictly")
        self.taken.append(note)
