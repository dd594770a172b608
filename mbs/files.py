"""Atomic writing of files, and checks of zip archives."""

from __future__ import annotations

import contextlib
import hashlib
import os
import secrets
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath

from mbs.errors import ExportError
from mbs.text import quoted

PathLike = str | os.PathLike[str]


def path_of(path: object) -> Path:
    """Return a path argument of a user as a Path.

    Args:
        path: text or os.PathLike.

    Raises:
        ExportError: the argument is neither a text nor a path.
    """
    if isinstance(path, (str, os.PathLike)) and isinstance(text := os.fspath(path), str):
        return Path(text)
    raise ExportError(f"{quoted(path)} is not a path; give the name of a file or folder")


@contextlib.contextmanager
def whole_file(path: PathLike, remedy: str = "choose a writable place") -> Iterator[Path]:
    """Provide a scratch file that replaces the target if the block succeeds.

    The scratch file is in the folder of the target. The target has the permissions of any new file,
    and keeps its old content until the end.

    Args:
        path: file to write.
        remedy: end of the error message if the file cannot be written.

    Yields:
        path of the scratch file, with the ending of the target, to be written by the block.

    Raises:
        ExportError: the file cannot be written. The scratch file is deleted.
    """
    target = path_of(path)
    folder = os.fspath(path).endswith(tuple(filter(None, ("/", os.sep, os.altsep))))
    if target.is_dir() or folder or not target.name:
        raise ExportError(f"{os.fspath(path)} is a folder; give the name of a file")
    scratch = target.with_name(f".{target.name[:40]}.{secrets.token_hex(8)}{target.suffix}")
    try:
        try:
            yield scratch
            scratch.replace(target)
        finally:
            scratch.unlink(missing_ok=True)
    except OSError as error:
        if isinstance(error, ExportError):
            raise
        raise ExportError(
            f"{target}: the file cannot be written ({error.strerror or error}); {remedy}"
        ) from error


def write_bytes(content: bytes, path: PathLike) -> None:
    """Write a file completely or not at all.

    Args:
        content: content of the file.
        path: file to write.

    Raises:
        ExportError: the file cannot be written.
    """
    with whole_file(path) as scratch:
        scratch.write_bytes(content)


def write_sealed(content: bytes, path: PathLike) -> None:
    """Write a file that begins with a hash of its content, for `read_sealed`.

    Args:
        content: content of the file.
        path: file to write.

    Raises:
        ExportError: the file cannot be written.
    """
    write_bytes(hashlib.sha256(content).hexdigest().encode() + b"\n" + content, path)


def read_sealed(path: PathLike) -> bytes:
    """Return the content of a file that `write_sealed` wrote, without the hash.

    Args:
        path: file to read.

    Raises:
        OSError: the file does not exist or cannot be read.
        ValueError: the file is damaged.
    """
    seal, _, content = path_of(path).read_bytes().partition(b"\n")
    if seal != hashlib.sha256(content).hexdigest().encode():
        raise ValueError(f"{os.fspath(path)} is damaged")
    return content


def write_text(text: str, path: PathLike) -> None:
    """Write a text file in UTF-8 completely or not at all, with its line ends unchanged.

    Args:
        text: content of the file.
        path: file to write.

    Raises:
        ExportError: the file cannot be written.
    """
    write_bytes(text.encode("utf-8"), path)


def write_texts(files: Mapping[str, str], folder: PathLike) -> None:
    """Write text files in UTF-8 into a folder, created if necessary: all of them or none.

    Args:
        files: dict from file name to text.
        folder: folder of the files.

    Raises:
        ExportError: the folder cannot be written.
    """
    target, remedy = path_of(folder), "choose a folder that can be written"
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ExportError(
            f"folder {target} cannot be made ({error.strerror or error}); {remedy}"
        ) from error
    with contextlib.ExitStack() as stack:
        for name, text in files.items():
            scratch = stack.enter_context(whole_file(target / name, remedy))
            scratch.write_bytes(text.encode("utf-8"))


# Checks of zip archives of unknown origin, such as FMUs, before they are unpacked.


MOST_BYTES = 2 * 1024**3
"""Largest unpacked size: FMUs with tables and libraries for several platforms have some 100 MB."""

MOST_TIMES = 100
"""Largest ratio of unpacked and packed size. FMUs have about 4, a single XML file about 15. A
malicious file that fills a disk has 1000, the maximum of deflate."""

HARMLESS_BYTES = 64 * 1024**2
"""Unpacked size up to which any ratio is accepted: a table of zeros has a large ratio too."""

MOST_ENTRIES = 20_000
"""Largest number of entries, each of which becomes a file. FMUs with Python have some thousand."""


def check_archive(path: Path) -> None:
    """Raise if a zip file would unpack to too much data, or outside of its folder.

    Only its table of contents is read. `zipfile` unpacks no more of an entry than the table
    specifies.

    Args:
        path: path of the zip file.

    Raises:
        ValueError: the archive is not acceptable; the message is the end of a sentence about it.
        zipfile.BadZipFile: the file is no zip file.
        OSError: the file cannot be read.
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
    """Return whether an entry name could lead out of the folder in which it is unpacked.

    It then has `..`, a drive, a leading slash, a backslash or a null character.
    """
    parts = PurePosixPath(name).parts
    return ".." in parts or name.startswith("/") or any(sign in name for sign in "\\:\0")


def _size(count: int) -> str:
    """Return a number of bytes as text in GB or MB."""
    return f"{count / 1e9:.2g} GB" if count >= 1e9 else f"{count / 1e6:.2g} MB"
