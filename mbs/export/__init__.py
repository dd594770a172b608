"""Files that other tools run: C source, FMUs."""

from mbs.export.c_library import c_library
from mbs.export.code import code
from mbs.export.fmu.system_fmu import fmu
from mbs.export.par import par

__all__ = ["c_library", "code", "fmu", "par"]
