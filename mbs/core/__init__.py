"""The run-time library: numerical methods in C, compiled when the package is built.

The C files in `source` need no model. FMUs contain the same files.
"""

from mbs.core.evaluations import (
    code_address,
    compiled_evaluation,
    interpreted_evaluation,
    python_evaluation,
    reraise,
    work_sizes,
)
from mbs.core.library import core_files, core_library

__all__ = [
    "code_address",
    "compiled_evaluation",
    "core_files",
    "core_library",
    "interpreted_evaluation",
    "python_evaluation",
    "reraise",
    "work_sizes",
]
