"""The run-time library: numerical methods in C, compiled when the package is built.

The C files in `source` need no model. FMUs contain the same files.
"""

from mbs.core.library import core_files, core_library

__all__ = ["core_files", "core_library"]
