"""The C compiler of this computer: which one there is, and shared libraries made with it."""

import functools
import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mbs.errors import CompilerError
from mbs.messages import install_command

FLAGS = ("-O2", "-ffp-contract=off", "-fPIC", "-shared")
"""Contraction is off so that compiled code gives the very bits of the interpreted Function."""

_LEVELS = ((20_000, "-O2"), (200_000, "-O1"))  # beyond, compilers need minutes or give up

LIBRARY_SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")

_KNOWN = ("cc", "gcc", "clang")


@dataclass(frozen=True, slots=True)
class Compiler:
    """A C compiler.

    Attributes:
        command: the words that start it.
        version: what it says it is; two compilers that differ here may give different code.
    """

    command: tuple[str, ...]
    version: str


def find_compiler() -> Compiler:
    """The compiler that CC names, else cc, gcc or clang, else the one inside ziglang.

    Returns:
        the first of them that starts.

    Raises:
        CompilerError: none is installed, or the one that CC names does not start.
    """
    return _find(os.environ.get("CC", ""), os.environ.get("PATH", ""))


def compiler_found() -> bool:
    """Whether this computer has a C compiler.

    Returns:
        False when CC is not set and none is installed.

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
def _find(wanted: str, path: str) -> Compiler:
    if wanted.strip():
        compiler = _probe(_words(wanted), path)
        if compiler is None:
            raise CompilerError(
                f"environment variable CC is {wanted!r} and does not start; set it to a C compiler "
                "or unset it"
            )
        return compiler
    candidates: list[tuple[str, ...]] = [(name,) for name in _KNOWN]
    if importlib.util.find_spec("ziglang") is not None:
        candidates.append((sys.executable, "-m", "ziglang", "cc"))
    for command in candidates:
        compiler = _probe(command, path)
        if compiler is not None:
            return compiler
    raise CompilerError(
        "no C compiler was found; install gcc or clang, or run: " + install_command("cross")
    )


def _words(command: str) -> tuple[str, ...]:
    try:
        return tuple(shlex.split(command, posix=os.name != "nt"))
    except ValueError:  # a quote is open
        return (command,)


def _probe(command: tuple[str, ...], path: str) -> Compiler | None:
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
    """The flags for generated code: the longer it is, the less a compiler can afford.

    Args:
        source: text of the longest C file.

    Returns:
        FLAGS with another level of optimization; the numbers that the code gives are the same.
    """
    lines = source.count("\n")
    level = next((name for limit, name in _LEVELS if lines <= limit), "-O0")
    return (level, *FLAGS[1:])


def compile_library(
    sources: Sequence[Path],
    include_dirs: Sequence[Path] = (),
    flags: Sequence[str] = FLAGS,
    output: Path = Path("library" + LIBRARY_SUFFIX),
    *,
    compiler: Compiler | None = None,
) -> Path:
    """Compile C files into one shared library that brings its own libm reference.

    Args:
        sources: C files.
        include_dirs: folders searched for headers.
        flags: every flag, including those that make the library shared.
        output: library to write.
        compiler: that builds it, the one of this computer when left out.

    Returns:
        the library.

    Raises:
        CompilerError: there is no compiler, or it refused the code.
    """
    compiler = compiler or find_compiler()
    includes = [f"-I{folder}" for folder in include_dirs]
    libm = [] if output.suffix == ".dll" else ["-lm"]
    files = [str(source) for source in sources]
    command = [*compiler.command, *flags, *includes, *files, "-o", str(output), *libm]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    if answer.returncode != 0:
        complaint = _complaint(answer.stderr)
        names = ", ".join(source.name for source in sources)
        raise CompilerError(f"{compiler.command[0]} refused {names}: {complaint.strip()[:500]}")
    return output


def _complaint(stderr: str) -> str:
    """The line that says what is wrong; of a linker, the symbol that is missing."""
    lines = stderr.splitlines()
    found = (s for word in ("undefined reference", "error") for s in lines if word in s)
    return next(found, stderr)
