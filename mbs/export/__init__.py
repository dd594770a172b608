"""Files that other tools run: C source, FMUs, systems of FMUs."""

from mbs.export.c_library import c_library
from mbs.export.code import code
from mbs.export.fmu.controller import CController
from mbs.export.fmu.inverse_geometry_fmu import inverse_geometry_fmu
from mbs.export.fmu.system_fmu import fmu
from mbs.export.mjcf import mjcf
from mbs.export.par import par
from mbs.export.sdf import sdf
from mbs.export.ssp import ssp
from mbs.export.urdf import urdf

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
