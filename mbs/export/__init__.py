"""Files that other tools run: C source, FMUs."""

from mbs.export.c_library import c_library
from mbs.export.fmu.system_fmu import fmu

__all__ = ["c_library", "fmu"]
