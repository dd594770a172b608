"""Zip files of others, such as FMUs: what is refused before anything of them is unpacked."""

from __future__ import annotations

import zipfile
from pathlib import Path, PurePosixPath

MOST_BYTES = 2 * 1024**3
"""Unpacked. FMUs with tables and libraries for several platforms have some hundred MB."""

MOST_TIMES = 100
"""Unpacked size by packed size. FMUs have about 4, an XML file alone about 15; a file made to fill
a disk has 1000, the most that deflate can reach."""

HARMLESS_BYTES = 64 * 1024**2
"""Unpacked size to which any ratio is taken: a table of zeros shrinks like a bomb."""

MOST_ENTRIES = 20_000
"""Each becomes a file. FMUs with a whole run-time of Python inside have some thousand."""


def check_archive(path: Path) -> None:
    """Refuse a zip file that unpacks to too much, or outside of its folder.

    Its table of contents is read, and nothing else. Unpacking by `zipfile` writes no more of an
    entry than that table says.

    Args:
        path: the file.

    Raises:
        ValueError: says why, in the middle of a sentence about the file.
        zipfile.BadZipFile: it is no zip file.
        OSError: it cannot be read.
    """
    with zipfile.ZipFile(path) as archive:
        entries = archive.infolist()
    packed, unpacked = path.stat().st_size, sum(entry.file_size for entry in entries)
    if len(entries) > MOST_ENTRIES:
        raise ValueError(
            f"it has {len(entries)} entries, and {MOST_ENTRIES} are the most that are unpacked;"
            " pack it again without those that it does not need"
        )
    if unpacked > MOST_BYTES:
        raise ValueError(
            f"it would unpack to {_size(unpacked)}, and {_size(MOST_BYTES)} are the most; pack it"
            " again without what it does not need"
        )
    if unpacked > HARMLESS_BYTES and unpacked > MOST_TIMES * packed:
        raise ValueError(
            f"it would unpack to {_size(unpacked)}, {unpacked / packed:.0f} times its size of"
            f" {_size(packed)}, and {MOST_TIMES} times is the most; use one whose content you know"
        )
    for entry in entries:
        if _leads_outside(entry.orig_filename):
            raise ValueError(
                f"its entry {entry.orig_filename!r} leads out of the folder in which it is"
                " unpacked; use one whose content you know"
            )


def _leads_outside(name: str) -> bool:
    """A name with `..`, a drive, a leading slash, or slashes of Windows, which hide them."""
    parts = PurePosixPath(name).parts
    return ".." in parts or name.startswith("/") or any(sign in name for sign in "\\:\0")


def _size(count: int) -> str:
    return f"{count / 1e9:.2g} GB" if count >= 1e9 else f"{count / 1e6:.2g} MB"
