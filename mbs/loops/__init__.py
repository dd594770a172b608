"""Closed loops: closure equations, their independent rows, postures, reduction."""

from mbs.loops.closure import closure
from mbs.loops.posture import solve
from mbs.loops.reduction import reduction_matrix
from mbs.loops.velocity import closure_jacobian

__all__ = ["closure", "closure_jacobian", "reduction_matrix", "solve"]
