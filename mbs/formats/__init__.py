"""Readers and writers of robot files: tables of frames (TOML, dict, .par), URDF, SDF and MJCF."""

from mbs.formats.mjcf.reader import read_mjcf
from mbs.formats.par import read_par, write_par
from mbs.formats.sdf.reader import read_sdf
from mbs.formats.table import CutRow, FrameRow, InertiaRow, RobotTable, to_mechanism
from mbs.formats.toml import from_dict, read_toml, to_dict, write_toml
from mbs.formats.urdf.reader import read_urdf

__all__ = [
    "CutRow",
    "FrameRow",
    "InertiaRow",
    "RobotTable",
    "from_dict",
    "read_mjcf",
    "read_par",
    "read_sdf",
    "read_toml",
    "read_urdf",
    "to_dict",
    "to_mechanism",
    "write_par",
    "write_toml",
]
