"""A force and a moment about one point."""

import casadi
from casadi import SX

from mbs.spatial.pose import Pose
from mbs.spatial.vectors import cross

Wrench = tuple[SX, SX]
"""Force (3, 1) and moment (3, 1) about the origin of a frame, in that frame [N, N m]."""


def add_wrenches(a: Wrench, b: Wrench) -> Wrench:
    """The sum of two wrenches about one point."""
    return a[0] + b[0], a[1] + b[1]


def carried(pose: Pose, wrench: Wrench) -> Wrench:
    """A wrench about and in frame j, about and in the frame i in which frame j has this pose."""
    force, moment = (casadi.mtimes(pose.R, part) for part in wrench)
    return force, moment + cross(pose.p, force)
