"""Shared libraries of fast code, made for the processor of this computer."""

from __future__ import annotations

import functools
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path

from casadi import Function

from mbs.errors import ModelError
from mbs.native.cache import cached_library
from mbs.native.kernel_source import kernel_source

_NATIVE = "-march=native" if platform.machine().lower() in ("x86_64", "amd64") else "-mcpu=native"
FAST_FLAGS = (
    "-O2",
    _NATIVE,
    "-ffp-contract=fast",
    "-fno-math-errno",
    "-fno-tree-slp-vectorize",
    "-Wno-psabi",
    "-fPIC",
    "-shared",
)
"""Contraction fuses multiplications and additions; nothing is assumed about infinities or NaN."""


def kernel_library(
    functions: Sequence[Function], further: Mapping[str, str] | None = None
) -> Path | None:
    """The library of fast code of Functions with different names.

    Args:
        functions: what to compile.
        further: file name to text of what else belongs to it.

    Returns:
        path of the library; None when some Function is not made of scalar operations that C has,
        and of maps of them.

    Raises:
        CompilerError: there is no compiler, or it refused the code.
    """
    try:
        files = kernel_source(functions)
    except ModelError:
        return None
    notes = {"processor.h": f"/* {processor()} */\n"}
    return cached_library({**files, **(further or {}), **notes}, FAST_FLAGS)


@functools.cache
def processor() -> str:
    """What tells apart processors on which code of this one may not run."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8", "replace").splitlines()
    except OSError:
        return f"{platform.processor()} of {platform.node()}"
    keys = ("model name", "flags", "Features", "CPU part", "CPU architecture")
    return " ".join(dict.fromkeys(line for line in lines if line.startswith(keys)))
