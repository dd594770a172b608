"""When two postures are the same: up to whole turns, and to the sign of quaternions."""

from __future__ import annotations

import numpy as np

from mbs.assembly import System
from mbs.assembly.rates import quaternion_slices
from mbs.loops.closing import Vector


def difference(system: System, q: Vector, other: Vector) -> Vector:
    """(nq,) difference of two postures: angles to the nearest whole turn, quaternions to a sign."""
    gap = within_half_turn(system, q - other)
    for part in quaternion_slices(system.tree):
        opposite = q[part] + other[part]
        gap[part] = min(q[part] - other[part], opposite, key=lambda x: float(np.abs(x).max()))
    return gap


def within_half_turn(system: System, q: Vector) -> Vector:
    """(nq,) the positions, or differences of them, with angles within half a turn of zero."""
    turned = np.array(q, dtype=float)
    turns = [coordinate.unit == "rad" for coordinate in system.coordinates]
    turned[turns] = np.remainder(turned[turns] + np.pi, 2 * np.pi) - np.pi
    return turned
