"""Bytes and texts read from files, and names that components can bear."""

from __future__ import annotations

import codecs
import io
import re
import stat
from pathlib import Path

from mbs.errors import DescriptionError
from mbs.text import quoted, seen

LARGEST_FILE = 64_000_000
"""Bytes that are read of a file; the largest descriptions of robots have a few millions."""
LONGEST_NAME = 80
"""Letters that a name keeps, as many as messages quote."""

_NOT_IN_NAMES = re.compile(r"[\s.'\"]+")
_MARKS = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}


def read_bytes(path: str | Path) -> bytes:
    """The content of a file.

    Raises:
        DescriptionError: it is no path, there is no such file, it is not a plain one, it has more
            bytes than `LARGEST_FILE`, or it cannot be read.
    """
    try:
        place = Path(path)
        plain = stat.S_ISREG(place.stat().st_mode)  # a pipe or a device may never end
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
    """The text of a file, UTF-8 or what its byte-order mark says; other bytes are replaced.

    Raises:
        DescriptionError: as in `read_bytes`.
    """
    return decoded(read_bytes(path))


def decoded(content: bytes, encoding: str = "utf-8") -> str:
    """A text by its byte-order mark, else in an encoding; bad bytes are replaced."""
    for mark, name in _MARKS.items():
        if content.startswith(mark):
            return content.decode(name, errors="replace")
    return content.decode(encoding, errors="replace")


def component_name(text: str) -> str:
    """The text with blanks, dots and quotes replaced by underscores, without unseen letters."""
    return seen(_NOT_IN_NAMES.sub("_", text.strip()))[:LONGEST_NAME]
