"""Shared libraries kept on disk under the hash of all that made them, so none is built twice."""

import atexit
import functools
import hashlib
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import casadi

from mbs.errors import CompilerError
from mbs.native.compiler import FLAGS, LIBRARY_SUFFIX, Compiler, compile_library, find_compiler


def cache_dir() -> Path:
    """The folder of built libraries: MBS_CACHE_DIR, else the cache folder of the user.

    Returns:
        a folder that exists and can be written: one that lasts as long as this process when the
        usual one cannot.
    """
    wanted = _wanted_dir()
    if wanted is not None and _writable(wanted):
        return wanted
    return _process_dir()


def cached_library(
    files: Mapping[str, str],
    flags: Sequence[str] = FLAGS,
    *,
    compiler: Compiler | None = None,
    suffix: str = LIBRARY_SUFFIX,
) -> Path:
    """The shared library of these sources, built when nobody has built it yet.

    Two processes may ask at once: each builds in a folder of its own and the last to finish wins.
    The name of a library holds a hash of its content; one that is damaged is built again.

    Args:
        files: file name to its text; names that end in .c are compiled, the others are headers.
        flags: every flag of the compiler.
        compiler: that builds it, the one of this computer when left out.
        suffix: of the library.

    Returns:
        path of the library.

    Raises:
        CompilerError: there is no compiler, or it refused the code.
    """
    folder, chosen = cache_dir(), compiler or find_compiler()
    key = _key(files, flags, chosen)
    for known in sorted(folder.glob(f"{key}-*{suffix}")):
        if is_whole(known):
            return known
    with tempfile.TemporaryDirectory(dir=folder, prefix="build-") as name:
        build = Path(name)
        for file, text in files.items():
            (build / file).write_text(text, encoding="utf-8")
        sources = [build / file for file in files if file.endswith(".c")]
        output = build / f"library{suffix}"
        library = compile_library(sources, [build], flags, output, compiler=chosen)
        return _installed(library, folder / f"{key}-{_sum_of(library)}{suffix}")


def is_whole(library: Path) -> bool:
    """Whether the content of a library of the cache is that which its name tells."""
    try:
        facts = library.stat()
        return _checked(library, facts.st_mtime_ns, facts.st_size)
    except OSError:  # it has gone, or another user keeps it to himself
        return False


@functools.lru_cache(maxsize=1024)
def _checked(library: Path, changed: int, size: int) -> bool:
    return library.stem.rpartition("-")[2] == _sum_of(library)


def _sum_of(library: Path) -> str:
    with library.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()[:16]


def _key(files: Mapping[str, str], flags: Sequence[str], compiler: Compiler) -> str:
    digest = hashlib.sha256()
    facts = (casadi.CasadiMeta.version(), platform.machine(), *compiler.command, compiler.version)
    texts = (text for name in sorted(files) for text in (name, files[name]))
    for text in (*facts, *flags, *texts):
        digest.update(text.encode())
        digest.update(b"\0")
    return digest.hexdigest()[:40]


def _installed(library: Path, target: Path) -> Path:
    """The target; where another user keeps one of its name to himself, a copy for this process."""
    try:
        os.replace(library, target)
    except OSError as error:
        if not target.exists():
            raise CompilerError(
                f"library {target} could not be stored ({error}); set MBS_CACHE_DIR to a folder "
                "that you may write"
            ) from error
        if not is_whole(target):  # else another process holds it open, which some systems protect
            return Path(shutil.copy(library, _process_dir() / target.name))
    return target


def _wanted_dir() -> Path | None:
    override = os.environ.get("MBS_CACHE_DIR")
    if override:
        return Path(override)
    try:
        home = Path.home()
    except RuntimeError:
        return None
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local") / "mbs" / "cache"
    if sys.platform == "darwin":
        return home / "Library" / "Caches" / "mbs"
    return Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache") / "mbs"


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


@functools.cache
def _process_dir() -> Path:
    folder = tempfile.mkdtemp(prefix="mbs-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)
