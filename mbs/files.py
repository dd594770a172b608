"""Files written as a whole, or not at all."""

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
    """The path that a user gave.

    Raises:
        ExportError: it is neither a text nor a path.
    """
    if isinstance(path, (str, os.PathLike)) and isinstance(text := os.fspath(path), str):
        return Path(text)
    raise ExportError(f"{quoted(path)} is not a path; give the name of a file or folder")


@contextlib.contextmanager
def whole_file(path: PathLike, remedy: str = "choose a writable place") -> Iterator[Path]:
    """A scratch file beside the target that takes its place when the block ends well.

    The target has the permissions of any new file, and its old content until the end.

    Args:
        path: file to write.
        remedy: end of the message when it cannot be written.

    Yields:
        the scratch file, which has the ending of the target and which the block fills.

    Raises:
        ExportError: the file cannot be written; nothing is left behind.
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
    """Write a file as a whole or not at all.

    Raises:
        ExportError: the file cannot be written.
    """
    with whole_file(path) as scratch:
        scratch.write_bytes(content)


def write_sealed(content: bytes, path: PathLike) -> None:
    """Write a file that begins with a hash of its content, for `read_sealed`.

    Raises:
        ExportError: the file cannot be written.
    """
    write_bytes(hashlib.sha256(content).hexdigest().encode() + b"\n" + content, path)


def read_sealed(path: PathLike) -> bytes:
    """What `write_sealed` wrote.

    Raises:
        OSError: there is no such file, or it cannot be read.
        ValueError: it is damaged.
    """
    seal, _, content = path_of(path).read_bytes().partition(b"\n")
    if seal != hashlib.sha256(content).hexdigest().encode():
        raise ValueError(f"{os.fspath(path)} is damaged")
    return content


def write_text(text: str, path: PathLike) -> None:
    """Write a file of UTF-8 as a whole or not at all; line ends are kept as they are.

    Raises:
        ExportError: the file cannot be written.
    """
    write_bytes(text.encode("utf-8"), path)


def write_texts(files: Mapping[str, str], folder: PathLike) -> None:
    """Write files of UTF-8 into a folder, made when it is not there; all of them or none.

    Args:
        files: name to text.
        folder: where.

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


# Zip files of others, such as FMUs: what is refused before anything of them is unpacked.


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
