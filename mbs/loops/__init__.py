"""Closed loops: closure equations, their independent rows, configurations, reduction."""

from mbs.deprecation import moved
from mbs.loops._function import function
from mbs.loops.closure_equations import closure_residual
from mbs.loops.configuration import solve
from mbs.loops.examination import ConfigurationReport, configuration_report
from mbs.loops.mode_search import Mode, ModeList, WorkingMode, assembly_modes, working_modes
from mbs.loops.pose import solve_pose
from mbs.loops.reduction import reduction_matrix
from mbs.loops.velocity import closure_jacobian

__getattr__ = moved(
    __name__,
    {
        "examine": "mbs.loops.configuration_report",
        "ConfigurationState": "mbs.loops.ConfigurationReport",
        "modes": "mbs.loops.assembly_modes",
        "closure": "mbs.loops.closure_residual",
    },
)

__all__ = [
    "ConfigurationReport",
    "Mode",
    "ModeList",
    "WorkingMode",
    "assembly_modes",
    "closure_jacobian",
    "closure_residual",
    "configuration_report",
    "function",
    "reduction_matrix",
    "solve",
    "solve_pose",
    "working_modes",
]
