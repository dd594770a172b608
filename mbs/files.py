"""Files written as a whole, or not at all."""

import contextlib
import os
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

from mbs.errors import ExportError
from mbs.messages import quoted

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
    try:
        with tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.name[:40]}.") as name:
            scratch = Path(name) / f"scratch{target.suffix}"
            yield scratch
            scratch.replace(target)
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
