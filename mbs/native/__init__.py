"""Machine code: the C compiler, cached libraries, compiled Functions and the C run-time."""

from mbs.native._batch import Batch, batch
from mbs.native._compiled import c_source, compiled, link_flags
from mbs.native.compiler import (
    Compiler,
    cached_library,
    compile_library,
    compiler_found,
    find_compiler,
)

__all__ = [
    "Batch",
    "Compiler",
    "batch",
    "c_source",
    "cached_library",
    "compile_library",
    "compiled",
    "compiler_found",
    "find_compiler",
    "link_flags",
]
