"""Reading of bytes and texts from robot files, and the notes on them."""

from __future__ import annotations

import codecs
import io
import stat
from dataclasses import dataclass, field
from pathlib import Path

from mbs.components.notes import ImportNote, NoteKind
from mbs.errors import DescriptionError
from mbs.text import quoted

LARGEST_FILE = 64_000_000
"""Maximum number of bytes of a file; the largest robot descriptions have a few millions."""

_MARKS = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}


def read_bytes(path: str | Path) -> bytes:
    """Return the content of a file.

    Args:
        path: path of the file.

    Raises:
        DescriptionError: the argument is not a path, the file does not exist or is not a regular
            file, it has more than `LARGEST_FILE` bytes, or it cannot be read.
    """
    try:
        place = Path(path)
        plain = stat.S_ISREG(place.stat().st_mode)  # reading a pipe or a device may never end
        with place.open("rb") if plain else io.BytesIO() as file:
            content = file.read(LARGEST_FILE + 1)
    except (TypeError, ValueError):
        raise DescriptionError(
            f"robot file {quoted(path)}: it is not a path; give the path of a readable file"
        ) from None
    except OSError as error:
        raise DescriptionError(
            f"{path}: the file cannot be read ({error.strerror}); give the path of a readable file"
        ) from None
    if not plain:
        raise DescriptionError(
            f"{path}: the file cannot be read (it is a folder, a pipe or a device); give the path"
            " of a readable file"
        )
    if len(content) > LARGEST_FILE:
        raise DescriptionError(
            f"{path}: the file has more than {LARGEST_FILE} bytes; give the description of a robot"
        )
    return content


def read_text(path: str | Path) -> str:
    """Return the text of a file, decoded by its byte-order mark or as UTF-8.

    Each invalid byte becomes the replacement character U+FFFD.

    Args:
        path: path of the file.

    Raises:
        DescriptionError: the errors of `read_bytes`.
    """
    return decoded(read_bytes(path))


def decoded(content: bytes, encoding: str = "utf-8") -> str:
    """Decode bytes by their byte-order mark, or with `encoding` if there is no such mark.

    Each invalid byte becomes the replacement character U+FFFD.

    Args:
        content: bytes of a text.
        encoding: encoding of a text without byte-order mark.

    Raises:
        LookupError: `encoding` is unknown.
    """
    for mark, name in _MARKS.items():
        if content.startswith(mark):
            return content.decode(name, errors="replace")
    return content.decode(encoding, errors="replace")


# Import notes of the file readers. In strict mode each note is an error.


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
