"""How frames of cut joints move: velocities from the rates of their poses."""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.assembly.rates import position_rate
from mbs.spatial import Pose


def cut_twist(system: System, pose: Pose, q: SX, v: SX) -> tuple[SX, SX]:
    """Velocity (3, 1) of the origin and angular velocity (3, 1) of a frame seen from another one.

    Args:
        system: with closed loops.
        pose: of the frame at the positions q, such as that of frame_b seen from frame_a.
        q: (nq, 1) symbols of positions.
        v: (nv, 1) velocities of the tree.

    Returns:
        both in the axes from which the frame is seen [m/s, rad/s].
    """
    rate = position_rate(system.tree, q, v)
    R_dot = casadi.reshape(casadi.jtimes(casadi.vec(pose.R), q, rate), 3, 3)
    spin = casadi.mtimes(R_dot, pose.R.T)
    return casadi.jtimes(pose.p, q, rate), casadi.vertcat(spin[2, 1], spin[0, 2], spin[1, 0])
