"""Texts read from files and written to them, and names that components can bear."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path

from mbs.errors import DescriptionError, ExportError

_NOT_IN_NAMES = re.compile(r"[\s.'\"]+")


def read_text(path: str | Path) -> str:
    """The text of a file; bytes that are not UTF-8 are replaced.

    Raises:
        DescriptionError: there is no such file, or it cannot be read.
    """
    try:
        return Path(path).read_bytes().decode("utf-8", errors="replace")
    except OSError as error:
        raise DescriptionError(
            f"{path}: the file cannot be read ({error.strerror}); give the path of a readable file"
        ) from None


def write_text(text: str, path: str | Path) -> None:
    """Write a file as a whole or not at all.

    Raises:
        ExportError: the file cannot be written.
    """
    target = Path(path)
    scratch = None
    try:
        handle, scratch = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        Path(scratch).chmod(0o644)
        Path(scratch).replace(target)
    except OSError as error:
        if scratch is not None:
            Path(scratch).unlink(missing_ok=True)
        raise ExportError(
            f"{path}: the file cannot be written ({error.strerror}); choose a writable place"
        ) from None


def component_name(text: str) -> str:
    """The text with blanks, dots and quotes replaced by underscores."""
    return _NOT_IN_NAMES.sub("_", text.strip())


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """The end of a message about an unknown name: the nearest known one, then all of them."""
    names = list(known)
    near = get_close_matches(name, names, n=1)
    hint = f"did you mean {near[0]!r}? " if near else ""
    return f"{hint}use one of {', '.join(names) or '(none)'}"
