"""Closed loops: closure equations, their independent rows, configurations, reduction."""

from mbs.loops.closure import closure
from mbs.loops.configuration import solve
from mbs.loops.examine import ConfigurationState, examine
from mbs.loops.function import function
from mbs.loops.modes import Mode, ModeList, WorkingMode, modes, working_modes
from mbs.loops.pose import solve_pose
from mbs.loops.reduction import reduction_matrix
from mbs.loops.velocity import closure_jacobian

assembly_modes = modes
"""Alias of `modes`, the term in the literature on parallel robots."""

__all__ = [
    "ConfigurationState",
    "Mode",
    "ModeList",
    "WorkingMode",
    "assembly_modes",
    "closure",
    "closure_jacobian",
    "examine",
    "function",
    "modes",
    "reduction_matrix",
    "solve",
    "solve_pose",
    "working_modes",
]
