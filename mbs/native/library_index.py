"""Which library of the cache belongs to a Function, found without writing its C text again.

The text of a Function and its derivatives may take far longer to write than the library to load.
A small file, named by a hash of the serialised Function and of all else that decides the text,
holds the name of the library.
"""

from __future__ import annotations

import functools
import hashlib
import os
import tempfile
from collections.abc import Callable, Iterator
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path

import casadi

from mbs.native.cache import cache_dir, is_whole
from mbs.native.compiler import find_compiler
from mbs.native.kernel import FAST_FLAGS, processor

_SUFFIX = ".library"
_SOURCES = (".py", ".h", ".c")


def indexed_library(
    function: casadi.Function, options: str, make: Callable[[], Path | None]
) -> Path | None:
    """The library that `make` gives for a Function, remembered from run to run.

    Several processes may ask at once; what is damaged or has gone is made again.

    Args:
        function: that is compiled.
        options: what else decides the library.
        make: writes and compiles it; None where that cannot be done, which is not remembered.
    """
    try:
        text = function.serialize()
    except (RuntimeError, NotImplementedError):  # a callback has no text
        return make()
    folder = cache_dir()
    entry = folder / f"{_key(text, options)}{_SUFFIX}"
    known = _entry(entry)
    if known is not None:
        return known
    library = make()
    if library is not None and library.parent == folder:
        _write(entry, library.name)
    return library


def _entry(entry: Path) -> Path | None:
    """The library that an entry names, when both are whole."""
    try:
        name = entry.read_text("utf-8")
        library = entry.parent / name
        return library if Path(name).name == name and is_whole(library) else None
    except (OSError, ValueError):
        return None


def _write(entry: Path, name: str) -> None:
    """Keep the name; where that fails, the next call writes the text of the Function again."""
    try:
        with tempfile.TemporaryDirectory(dir=entry.parent, prefix="build-") as folder:
            written = Path(folder) / entry.name
            written.write_text(name, encoding="utf-8")
            os.replace(written, entry)
    except OSError:  # the disk is full, or another process holds the entry open
        return


def _key(text: str, options: str) -> str:
    compiler = find_compiler()
    facts = (casadi.CasadiMeta.version(), *compiler.command, compiler.version, processor())
    digest = hashlib.sha256()
    for part in (*facts, *FAST_FLAGS, _writer(), options, text):
        digest.update(part.encode())
        digest.update(b"\0")
    return digest.hexdigest()[:40]


@functools.cache
def _writer() -> str:
    """A hash of the code that writes the text: another version may write another one."""
    digest = hashlib.sha256()
    for package in ("mbs.native", "mbs.operations"):
        for name, data in sorted(_files(resources.files(package), package)):
            digest.update(name.encode() + b"\0" + data + b"\0")
    return digest.hexdigest()


def _files(folder: Traversable, path: str) -> Iterator[tuple[str, bytes]]:
    for item in folder.iterdir():
        if item.is_dir() and item.name != "__pycache__":
            yield from _files(item, f"{path}/{item.name}")
        elif item.name.endswith(_SOURCES):
            yield f"{path}/{item.name}", item.read_bytes()
