"""Texts read from files, and names that components can bear."""

from __future__ import annotations

import re
from pathlib import Path

from mbs.errors import DescriptionError
from mbs.text import quoted, seen

_NOT_IN_NAMES = re.compile(r"[\s.'\"]+")


def read_text(path: str | Path) -> str:
    """The text of a file; bytes that are not UTF-8 are replaced.

    Raises:
        DescriptionError: it is no path, there is no such file, or it cannot be read.
    """
    try:
        return Path(path).read_bytes().decode("utf-8", errors="replace")
    except (TypeError, ValueError):
        raise DescriptionError(
            f"robot file {quoted(path)}: it is not a path; give the path of a readable file"
        ) from None
    except OSError as error:
        raise DescriptionError(
            f"{path}: the file cannot be read ({error.strerror}); give the path of a readable file"
        ) from None


def component_name(text: str) -> str:
    """The text with blanks, dots and quotes replaced by underscores, without unseen letters."""
    return seen(_NOT_IN_NAMES.sub("_", text.strip()))
