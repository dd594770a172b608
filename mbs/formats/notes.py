"""Import notes of the file readers. In strict mode each note is an error."""

from __future__ import annotations

from dataclasses import dataclass, field

from mbs.components.notes import ImportNote, NoteKind
from mbs.errors import DescriptionError


@dataclass(slots=True)
class Notes:
    """Collection of the import notes of one file.

    Attributes:
        path: path of the file, for error messages.
        strict: whether to raise an error instead of adding a note.
        lines: whether line numbers refer to the file; False for a text that was generated from it.
        taken: the notes, in reading order.
    """

    path: str
    strict: bool = False
    lines: bool = True
    taken: list[ImportNote] = field(default_factory=list)

    def add(self, kind: NoteKind, element: str, text: str, line: int | None = None) -> None:
        """Add a note; with `strict`, raise it as an error instead.

        Args:
            kind: kind of the note.
            element: element of the file, such as "link 'base'".
            text: text in the file and its interpretation.
            line: line number in the file.

        Raises:
            DescriptionError: `strict` is True.
        """
        note = ImportNote(kind, element, text, line if self.lines else None)
        if self.strict:
            raise DescriptionError(f"{self.path}: {note}; correct the file or read it not strictly")
        self.taken.append(note)
