"""C compiler: selection, shared libraries for this and other computers, and their cache."""

import atexit
import contextlib
import errno
import functools
import hashlib
import importlib.util
import os
import platform
import re
import shlex
import shutil
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import casadi

from mbs.core.build import COMPILERS, ZIG
from mbs.errors import CompilerError
from mbs.text import did_you_mean, install_command, quoted

FLAGS = ("-O2", "-ffp-contract=off", "-fPIC", "-shared")
"""Default flags. Contraction is off so that values are bit-identical to the interpreter."""

_LEVELS = ((20_000, "-O2"), (200_000, "-O1"))  # lines; longer code takes minutes or fails

LIBRARY_SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")

_ZIG = (
    *ZIG,
    "-g0",  # debug data contain names of temporary folders, which differ in each build
    # at -O0, zig adds checks of undefined behaviour, which change the last bits of values
    "-fno-sanitize=all",
    "-Wno-unused-command-line-argument",
)


@dataclass(frozen=True, slots=True)
class Compiler:
    """C compiler.

    Attributes:
        command: program and arguments that start the compiler.
        version: output of `--version`. Different versions may produce different code.
    """

    command: tuple[str, ...]
    version: str


def find_compiler() -> Compiler:
    """Return the compiler that CC names, else cc, gcc or clang, else ziglang.

    Returns:
        the first of these compilers that starts.

    Raises:
        CompilerError: no compiler is installed, or the compiler that CC names does not start.
    """
    return _find(os.environ.get("CC", ""), os.environ.get("PATH", ""))


def compiler_found() -> bool:
    """Return whether this computer has a C compiler.

    Returns:
        False if CC is not set and no compiler is installed.

    Raises:
        CompilerError: the compiler that CC names does not start.
    """
    try:
        find_compiler()
    except CompilerError:
        if os.environ.get("CC", "").strip():
            raise
        return False
    return True


@functools.lru_cache(maxsize=8)
def _find(chosen: str, path: str) -> Compiler:
    """Return the compiler `chosen` (the value of CC), or the first one in the folders of `path`.

    Raises CompilerError if it does not start, or no compiler is installed.
    """
    if chosen.strip():
        compiler = _probe(_words(chosen), path)
        if compiler is None:
            raise CompilerError(
                f"environment variable CC is {chosen!r} and does not start; set it to a C compiler "
                "or unset it"
            )
        return compiler
    candidates: list[tuple[str, ...]] = [(name,) for name in COMPILERS]
    if importlib.util.find_spec("ziglang") is not None:
        candidates.append(_ZIG)
    for command in candidates:
        compiler = _probe(command, path)
        if compiler is not None:
            return compiler
    raise CompilerError(
        "no C compiler was found; install gcc or clang, or run: " + install_command("cross")
    )


def _words(command: str) -> tuple[str, ...]:
    """Return the words of a command line; a single word if its quotes are unbalanced."""
    try:
        return tuple(shlex.split(command, posix=os.name != "nt"))
    except ValueError:  # unbalanced quotes
        return (command,)


def _probe(command: tuple[str, ...], path: str) -> Compiler | None:
    """Return the compiler that `command` starts; None if its --version fails.

    `path` is the search path of programs.
    """
    program = shutil.which(command[0], path=path)
    if program is None:
        return None
    words = (program, *command[1:])
    try:
        answer = subprocess.run(
            [*words, "--version"], capture_output=True, text=True, timeout=120, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return Compiler(words, answer.stdout) if answer.returncode == 0 else None


def flags_for(source: str) -> tuple[str, ...]:
    """Return flags for generated code; longer code is compiled with less optimization.

    Args:
        source: text of the longest C file.

    Returns:
        FLAGS with a different optimization level. The level does not change computed values.
    """
    lines = source.count("\n")
    level = next((name for limit, name in _LEVELS if lines <= limit), "-O0")
    return (level, *FLAGS[1:])


def chosen_flags(flags: Sequence[str]) -> tuple[str, ...]:
    """Return flags with the optimization level and the architecture that the user chose.

    Environment variable MBS_OPTIMIZE sets the level. Code without contraction computes the same
    values at every level. MBS_ARCHITECTURE sets the architecture, such as x86-64-v3. If it is
    unset, fast code is compiled for the processor of this computer.

    Args:
        flags: compiler flags.

    Raises:
        CompilerError: MBS_OPTIMIZE is no level, or MBS_ARCHITECTURE contains invalid characters.
    """
    level = os.environ.get("MBS_OPTIMIZE", "").strip()
    if level not in ("", "0", "1", "2", "3"):
        raise CompilerError(
            f"environment variable MBS_OPTIMIZE is {level!r}; set it to 0, 1, 2 or 3"
        )
    architecture = os.environ.get("MBS_ARCHITECTURE", "").strip()
    if not re.fullmatch(r"[A-Za-z0-9_.-]*", architecture):
        raise CompilerError(
            f"environment variable MBS_ARCHITECTURE is {architecture!r}; set it to a name that the"
            " compiler knows, such as x86-64-v3"
        )
    chosen = list(flags)
    if level:
        levels = {f"-O{number}" for number in range(4)}
        chosen = [f"-O{level}" if flag in levels else flag for flag in chosen]
    if architecture:
        chosen = [flag for flag in chosen if not flag.startswith(("-march=", "-mcpu="))]
        chosen.append(f"-march={architecture}")
    return tuple(chosen)


def compile_library(
    sources: Sequence[Path],
    include_dirs: Sequence[Path] = (),
    flags: Sequence[str] = FLAGS,
    output: Path = Path("library" + LIBRARY_SUFFIX),
    *,
    compiler: Compiler | None = None,
) -> Path:
    """Compile C files into a shared library that is linked with libm.

    Args:
        sources: C files.
        include_dirs: folders that are searched for headers.
        flags: all flags, including the flags that make the library shared.
        output: path of the library.
        compiler: compiler to use. Default: the compiler of this computer.

    Returns:
        path of the library.

    Raises:
        CompilerError: there is no compiler, or it rejects the code.
    """
    compiler = compiler or find_compiler()
    includes = [f"-I{folder}" for folder in include_dirs]
    libm = [] if output.suffix == ".dll" else ["-lm"]
    files = [str(source) for source in sources]
    _compile(compiler, [*flags, *includes, *files, "-o", str(output), *libm], sources)
    if not _is_library(output):
        raise CompilerError(
            f"{compiler.command[0]} wrote no library; name another compiler by the environment"
            " variable CC"
        )
    return output


_MAGIC = (b"\x7fELF", b"MZ", b"\xcf\xfa\xed\xfe", b"\xca\xfe\xba\xbe")
"""First bytes of shared libraries: Linux, Windows, macOS with one and with several processors."""


def _is_library(file: Path) -> bool:
    """Whether a file exists and begins like a shared library."""
    try:
        with file.open("rb") as stream:
            return stream.read(4).startswith(_MAGIC)
    except FileNotFoundError:
        return False


_LONGEST = 1800.0
"""Time limit of a compiler call [s]. The longest models take minutes; a hanging call ends here."""


def _compile(compiler: Compiler, arguments: Sequence[str], sources: Sequence[Path]) -> None:
    """Run the compiler with some arguments; `sources` are named in error messages.

    Raises:
        CompilerError: it does not start or exceeds the time limit, is killed, or rejects the code.
        OSError: the disk is full.
    """
    program, names = compiler.command[0], ", ".join(source.name for source in sources)
    try:
        with subprocess.Popen(
            [*compiler.command, *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
        ) as process:
            try:
                _, stderr = process.communicate(timeout=_LONGEST)
            except BaseException:
                process.kill()
                process.wait()  # control-C ends `subprocess.run` while the process still runs
                raise
    except subprocess.TimeoutExpired as error:
        raise CompilerError(
            f"{program} did not end within {_LONGEST:.0f} s at {names}; take shorter models, or"
            " another compiler by the environment variable CC"
        ) from error
    except OSError as error:
        raise CompilerError(
            f"{program} does not start ({error.strerror or error}); name another compiler by the"
            " environment variable CC"
        ) from error
    if process.returncode < 0:
        raise CompilerError(
            f"{program} was ended by signal {-process.returncode} at {names}; where memory was"
            " short, take shorter models"
        )
    if process.returncode != 0:
        if os.strerror(errno.ENOSPC) in stderr:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        complaint = _main_error(stderr)
        raise CompilerError(f"{program} refused {names}: {complaint.strip()[:500]}")


def _main_error(stderr: str) -> str:
    """Return the line of a compiler's error output that names the fault.

    It is the first line with "undefined reference", or else with "error"; all of `stderr` without
    such a line.
    """
    lines = stderr.splitlines()
    found = (s for word in ("undefined reference", "error") for s in lines if word in s)
    return next(found, stderr)


# Shared libraries for other computers, built with the compiler of ziglang.


_OLD_GLIBC = "2.17"
"""glibc version of libraries for Linux: every Linux in use since 2014 has it."""


@dataclass(frozen=True, slots=True)
class Platform:
    """Operating system and processor for which a library is built.

    Attributes:
        name: name in FMI 3.0.
        fmi2: name in FMI 2.0.
        target: name in ziglang.
        suffix: suffix of shared libraries.
    """

    name: str
    fmi2: str
    target: str
    suffix: str


PLATFORMS = {
    p.name: p
    for p in (
        Platform("x86_64-linux", "linux64", f"x86_64-linux-gnu.{_OLD_GLIBC}", ".so"),
        Platform("aarch64-linux", "aarch64-linux", f"aarch64-linux-gnu.{_OLD_GLIBC}", ".so"),
        Platform("x86_64-windows", "win64", "x86_64-windows-gnu", ".dll"),
        Platform("x86_64-darwin", "darwin64", "x86_64-macos", ".dylib"),
        Platform("aarch64-darwin", "aarch64-darwin", "aarch64-macos", ".dylib"),
    )
}


def host_platform() -> Platform:
    """Return the platform of this computer."""
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower())
    machine = machine or platform.machine().lower()
    system = {"win32": "windows", "darwin": "darwin"}.get(sys.platform, "linux")
    name = f"{machine}-{system}"
    return PLATFORMS.get(name, Platform(name, name, "", LIBRARY_SUFFIX))


def platform_named(name: object) -> Platform:
    """Return the platform with a name, such as "x86_64-linux".

    Args:
        name: name in FMI 3.0.

    Raises:
        CompilerError: no platform has this name.
    """
    if isinstance(name, str) and name in PLATFORMS:
        return PLATFORMS[name]
    raise CompilerError(
        f"there is no platform {quoted(name)}; {did_you_mean(str(name), list(PLATFORMS))}"
    )


def cross_compiler(goal: Platform) -> Compiler:
    """Return the compiler that builds libraries for a platform, on any computer.

    Args:
        goal: platform of the libraries.

    Raises:
        CompilerError: ziglang is not installed.
    """
    if importlib.util.find_spec("ziglang") is None:
        raise CompilerError(
            f"libraries for {goal.name} are made with ziglang, which is not installed; run: "
            + install_command("cross")
        )
    command = (*_ZIG, "-target", goal.target)
    return Compiler(command, metadata.version("ziglang"))


# Cache on disk: libraries are stored under a hash of everything that affects their code.


def cache_dir() -> Path:
    """Return the cache folder: MBS_CACHE_DIR, else the cache folder of the user.

    Libraries in this folder are executed. The folder must therefore belong to the user of this
    process, and write permission of other users is removed.

    Returns:
        an existing, writable folder. If the usual folder is not writable or belongs to another
        user, a temporary folder that is deleted at the end of this process.
    """
    chosen = _chosen_dir()
    if chosen is not None and _writable(chosen) and _is_own(chosen):
        _remove_orphans(chosen)
        return chosen
    return _process_dir()


def cached_library(
    files: Mapping[str, str],
    flags: Sequence[str] = FLAGS,
    *,
    compiler: Compiler | None = None,
    suffix: str = LIBRARY_SUFFIX,
    common: Collection[str] = (),
    together: Collection[str] = (),
) -> Path:
    """Return the shared library of C sources; it is compiled if it is not in the cache.

    Several processes may build the same library at once: each builds in its own folder, and the
    last to finish replaces the file. The file name contains a hash of the content; a damaged
    library is built again.

    Args:
        files: file name to text; names that end in .c are compiled, other files are headers.
        flags: all flags of the compiler; MBS_OPTIMIZE replaces the optimization level.
        compiler: compiler to use. Default: the compiler of this computer.
        suffix: suffix of the library file.
        common: names of C files that many libraries contain; their object files are cached too.
        together: names of C files that are compiled as a single file, which reads their headers
            once. They must not define the same name twice.

    Returns:
        path of the library.

    Raises:
        CompilerError: there is no compiler, or it rejects the code.
    """
    chosen, flags = compiler or find_compiler(), chosen_flags(flags)
    try:
        return _library_in(cache_dir(), files, flags, chosen, suffix, common, together)
    except OSError:  # the disk of the cache is full, or a cache file belongs to another user
        folder = _process_dir()
        try:
            return _library_in(folder, files, flags, chosen, suffix, common, together)
        except OSError as error:
            raise CompilerError(
                f"a library could not be built in {folder} ({error.strerror or error}); free space"
                " on its disk, or set MBS_CACHE_DIR to a folder on another one"
            ) from error


def known_library(files: Mapping[str, str], flags: Sequence[str] = FLAGS) -> Path | None:
    """Return the library of `cached_library` if it is in the cache, else None.

    Args:
        files: file name to text.
        flags: all flags of the compiler.

    Raises:
        CompilerError: there is no compiler.
    """
    compiler, flags = find_compiler(), chosen_flags(flags)
    return _undamaged_file(cache_dir(), _key(files, flags, compiler), LIBRARY_SUFFIX)


_TOGETHER = "all_of_them.c"
"""Name of the file in the build folder that includes the files of `together`."""


def _library_in(
    folder: Path,
    files: Mapping[str, str],
    flags: Sequence[str],
    compiler: Compiler,
    suffix: str,
    common: Collection[str],
    together: Collection[str],
) -> Path:
    """Return the library of `cached_library` in a cache folder; compile it if it is missing.

    The other arguments are those of `cached_library`.
    """
    key = _key(files, flags, compiler)
    known = _undamaged_file(folder, key, suffix)
    if known is not None:
        return known
    with tempfile.TemporaryDirectory(dir=folder, prefix=BUILD, ignore_cleanup_errors=True) as name:
        build = Path(name)
        for file, text in files.items():
            (build / file).write_text(text, encoding="utf-8")
        parts = [file for file in files if file.endswith(".c") and file not in together]
        if together:
            parts.append(_TOGETHER)
            lines = (f'#include "{file}"\n' for file in together)
            (build / _TOGETHER).write_text("".join(lines), encoding="utf-8")
        objects = _objects(parts, files, flags, compiler, build, common)
        output = build / f"library{suffix}"
        library = compile_library(objects, [build], flags, output, compiler=compiler)
        return _install(library, folder / f"{key}-{_checksum(library)}{suffix}")


_COMPILERS = 8
"""Largest number of compilers at the same time. Each takes about 0.1 GB. A long file is a third of
the work for an FMU, so that more compilers would be no faster."""


def _objects(
    parts: Sequence[str],
    files: Mapping[str, str],
    flags: Sequence[str],
    compiler: Compiler,
    build: Path,
    common: Collection[str],
) -> list[Path]:
    """Return the object files of C files in the build folder, compiled at the same time.

    A single file is returned itself: it is compiled and linked in one call.
    """
    if len(parts) == 1 and parts[0] not in common:
        return [build / parts[0]]

    def compiled(file: str) -> Path:
        if file in common:
            return _common_object(file, files, flags, compiler, build)
        return _object(build / file, _object_flags(flags), compiler)

    with ThreadPoolExecutor(min(os.cpu_count() or 1, _COMPILERS)) as workers:
        longest_first = sorted(parts, key=lambda file: file in common)
        found = {file: workers.submit(compiled, file) for file in longest_first}
        try:
            return [found[file].result() for file in parts]
        finally:
            workers.shutdown(cancel_futures=True)


def _undamaged_file(folder: Path, key: str, suffix: str) -> Path | None:
    """Return an undamaged file of a cache folder with this key and suffix, or None."""
    found = sorted(folder.glob(f"{key}-*{suffix}"))
    return next((known for known in found if is_whole(known)), None)


_INCLUDE = re.compile(r'^\s*#\s*include\s*"([^"]+)"', re.MULTILINE)


def _common_object(
    file: str, files: Mapping[str, str], flags: Sequence[str], compiler: Compiler, build: Path
) -> Path:
    """Return the cached object file of a C file, compiled in the folder `build` if it is missing.

    Its cache key covers text, headers and flags.
    """
    read = [file]
    for name in read:  # the list grows: headers may include headers
        read += [n for n in _INCLUDE.findall(files[name]) if n in files and n not in read]
    chosen = _object_flags(flags)
    key, folder = _key({name: files[name] for name in read}, chosen, compiler), build.parent
    known = _undamaged_file(folder, key, ".o")
    if known is not None:
        return known
    output = _object(build / file, chosen, compiler)
    return _install(output, folder / f"{key}-{_checksum(output)}.o")


def _object_flags(flags: Sequence[str]) -> list[str]:
    return [*(flag for flag in flags if flag not in ("-shared", "-s")), "-c"]


def _object(source: Path, flags: Sequence[str], compiler: Compiler) -> Path:
    """Compile a C file, with headers in its folder, to an object file beside it."""
    output = source.with_suffix(".o")
    _compile(compiler, [*flags, f"-I{source.parent}", str(source), "-o", str(output)], [source])
    return output


def is_whole(library: Path) -> bool:
    """Whether the content of a cached library matches the hash in its name.

    Args:
        library: path of the library.
    """
    try:
        facts = library.stat()
        return _checked(library, facts.st_mtime_ns, facts.st_size)
    except OSError:  # it was deleted, or another user made it unreadable
        return False


@functools.lru_cache(maxsize=1024)
def _checked(library: Path, changed: int, size: int) -> bool:
    """Whether a cached file matches its hash; cached by time of change [ns] and size [bytes]."""
    return library.stem.rpartition("-")[2] == _checksum(library)


def _checksum(library: Path) -> str:
    """Return the first 16 hexadecimal digits of the SHA-256 hash of the file `library`."""
    with library.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()[:16]


def _key(files: Mapping[str, str], flags: Sequence[str], compiler: Compiler) -> str:
    """Return the cache key of a library: a hash of `files` (name to text), `flags` and `compiler`.

    It includes the versions of CasADi and of the compiler, and the type of machine.
    """
    digest = hashlib.sha256()
    facts = (casadi.CasadiMeta.version(), platform.machine(), *compiler.command, compiler.version)
    texts = (text for name in sorted(files) for text in (name, files[name]))
    for text in (*facts, *flags, *texts):
        digest.update(text.encode())
        digest.update(b"\0")
    return digest.hexdigest()[:40]


def _install(library: Path, target: Path) -> Path:
    """Move a built library to `target` and return the path at which it can be loaded.

    If an unreadable file of another user is at the target, the library is copied to the temporary
    folder of this process.
    """
    try:
        os.replace(library, target)
    except OSError:
        if not target.exists():
            raise
        if not is_whole(target):  # else another process holds it open: it cannot be replaced
            return Path(shutil.copy(library, _process_dir() / target.name))
    return target


def _chosen_dir() -> Path | None:
    """Return the cache folder of MBS_CACHE_DIR or of the user; None without a home folder."""
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
    """Whether files can be written to a folder, which is created if it is missing."""
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _is_own(folder: Path) -> bool:
    """Whether a folder belongs to this user; write permission of other users is then removed."""
    if os.name != "posix":
        return True  # on Windows, user folders are closed to other users by default
    facts = folder.stat()
    if facts.st_uid != os.geteuid():
        return False
    if facts.st_mode & _OTHERS_WRITE:
        folder.chmod(facts.st_mode & ~_OTHERS_WRITE & 0o7777)
    return True


_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
BUILD = "build-"
"""Prefix of the names of build folders."""
_ORPHAN = 86_400.0
"""Age [s] from which a leftover build folder is deleted: no compilation takes a day."""


@functools.cache
def _remove_orphans(folder: Path) -> None:
    """Delete build folders in a cache folder that are older than a day; once per process."""
    for left in folder.glob(f"{BUILD}*"):
        with contextlib.suppress(OSError):
            if time.time() - left.stat().st_mtime > _ORPHAN:
                shutil.rmtree(left, ignore_errors=True)


@functools.cache
def _process_dir() -> Path:
    """Return the temporary folder of this process, which is deleted at its end."""
    folder = tempfile.mkdtemp(prefix="mbs-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)
