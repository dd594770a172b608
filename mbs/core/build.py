"""Compilation of the run-time library `mbs.core._core` from its C files.

The build hook of the package and an editable checkout use these functions. They use the
standard library only, since mbs is not installed when the package is built.
"""

from __future__ import annotations

import hashlib
import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Sequence
from pathlib import Path

SOURCE = Path(__file__).parent / "source"
LIBRARY = Path(__file__).parent / ("_core.pyd" if os.name == "nt" else "_core.abi3.so")
_FLAGS = (
    "-O3",
    "-std=c99",
    "-ffp-contract=off",  # contraction differs by processor and would change the results
    "-fvisibility=hidden",
    "-fPIC",
    "-shared",
    "-g0",
    "-s",
    "-DPy_LIMITED_API=0x030B0000",
)
_LIBRARIES = {
    "darwin": ("-undefined", "dynamic_lookup"),
    "win32": (f"-L{Path(sys.base_prefix, 'libs')}", "-lpython3"),
}
"""Libraries by platform. Symbols of Python come from the process, on Windows from python3.dll."""
COMPILERS = ("cc", "gcc", "clang")
"""Commands of C compilers, in the order in which they are looked for."""
ZIG = (sys.executable, "-m", "ziglang", "cc", "-mcpu=baseline")
"""Command of the compiler in ziglang. Without -mcpu, it uses instructions of this processor only,
which end a process on an older processor."""


class BuildError(RuntimeError):
    """The run-time library was not built."""


def source_sum() -> str:
    """Return the hash of the C files and flags. The built library contains it as text."""
    found = hashlib.sha256(" ".join(_FLAGS).encode())
    for file in sorted(SOURCE.glob("*.[ch]")):
        found.update(file.name.encode() + b"\0" + file.read_bytes())
    return found.hexdigest()


def is_current() -> bool:
    """Whether the library exists and was built from the present C files."""
    return LIBRARY.is_file() and source_sum().encode() in LIBRARY.read_bytes()


def installed_compiler() -> list[str] | None:
    """Return the command of the C compiler: CC, else cc, gcc or clang; None if there is none."""
    chosen = os.environ.get("CC", "").strip()
    if chosen:
        return shlex.split(chosen, posix=os.name != "nt")
    found = next((name for name in COMPILERS if shutil.which(name)), None)
    return None if found is None else [found]


def build(target: Path = LIBRARY, sources: Sequence[Path] | None = None) -> Path:
    """Compile the C files into the run-time library.

    Args:
        target: path of the library. It appears complete or not at all.
        sources: C files; all files of `SOURCE` by default.

    Returns:
        the target.

    Raises:
        BuildError: there is no compiler, Python.h is missing, or the compiler reports an error.
    """
    command = installed_compiler() or [*ZIG]
    include = Path(sysconfig.get_path("include"))
    if not (include / "Python.h").is_file():
        raise BuildError(
            f"mbs: the header Python.h is missing in {include}; install the development package"
            " of Python, such as python3-dev, or a wheel of casadi-mbs"
        )
    with tempfile.TemporaryDirectory(dir=target.parent, prefix=".build-") as folder:
        made = Path(folder) / target.name
        arguments = [
            *_FLAGS,
            f'-DCORE_SOURCES="{source_sum()}"',
            f"-I{include}",
            *map(str, sources or sorted(SOURCE.glob("*.c"))),
            *("-o", str(made)),
            *_LIBRARIES.get(sys.platform, ("-lm",)),
        ]
        _run([*command, *arguments])
        made.replace(target)
    return target


def _run(command: list[str]) -> None:
    """Run the compiler. Raise BuildError if it does not start or reports an error."""
    try:
        answer = subprocess.run(command, capture_output=True, text=True, errors="replace")
    except OSError as error:
        raise BuildError(
            f"mbs: the C compiler {command[0]} does not start ({error.strerror}); {_REMEDY}"
        ) from error
    if answer.returncode:
        if command[0] == sys.executable and "No module named ziglang" in answer.stderr:
            raise BuildError(f"mbs: there is no C compiler; {_REMEDY}")
        raise BuildError(
            f"mbs: the C compiler {command[0]} refused the run-time library:\n"
            + answer.stderr[-2000:]
        )


_REMEDY = (
    "install gcc, clang or the Python package ziglang, or name a C compiler in the environment"
    " variable CC"
)
