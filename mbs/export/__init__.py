"""Files that other tools run: C source, FMUs, systems of FMUs."""

from mbs.export._c_library import c_library
from mbs.export._code import code
from mbs.export._ssp import ssp
from mbs.export.fmu.controller import CController
from mbs.export.fmu.inverse_geometry_fmu import inverse_geometry_fmu
from mbs.export.fmu.system_fmu import fmu
from mbs.export.robot_files import mjcf, par, sdf, urdf

__all__ = [
    "CController",
    "c_library",
    "code",
    "fmu",
    "inverse_geometry_fmu",
    "mjcf",
    "par",
    "sdf",
    "ssp",
    "urdf",
]
