"""The equations of motion as a matrix times the inertial parameters of the links.

The motions of the links and the axes of the joints are computed once. An element is the work of a
unit wrench, that of one parameter of link j, in a unit velocity of a joint before it. What joint j
cannot tell from a part of link i is no new column: it is a sum of columns of link i.

Source: Khalil & Creusot 1997, section 6.1; Gautier & Khalil 1990 for the sums.
"""

from __future__ import annotations

from functools import partial

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.recursions.accelerations import Acceleration
from mbs.recursions.poses import LinkPose
from mbs.recursions.regressor_sums import Elements, filled
from mbs.recursions.regressor_twists import PathTwist, path_twists
from mbs.spatial import cross, vector, zeros

Unit = tuple[SX | None, SX | None]
"""Force and moment, or linear and angular momentum, of a unit of a parameter; None for zero."""


def inertial_regressor(tree: Tree, poses: list[LinkPose], motions: list[Acceleration]) -> list[SX]:
    """For every link the matrix (nv, 10) that gives the joint efforts of its ten parameters.

    Args:
        tree: the links.
        poses: each with respect to its antecedent.
        motions: of the links; see `link_accelerations`.
    """
    links: list[Elements] = []
    for motion, twists in zip(motions, path_twists(tree, poses), strict=True):
        units = unit_wrenches(motion)
        links.append({twist.row: partial(element, twist, units) for twist in twists})
    return filled(tree, poses, tree.nv, links)


def unit_wrenches(motion: Acceleration) -> list[Unit]:
    """The wrenches that move a link of which one inertial parameter is one, in their order."""
    w, wd, vd, U = motion.w, motion.wd, motion.vd, motion.rate.U
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    x_spread, y_spread, z_spread = motion.rate.spread
    moments = (
        (wd[0], xz, -xy),
        (-U[2, 0], U[2, 1], -z_spread),
        (U[1, 0], -y_spread, -U[1, 2]),
        (-yz, wd[1], xy),
        (-x_spread, -U[0, 1], U[0, 2]),
        (yz, -xz, wd[2]),
    )
    turning: list[Unit] = [(None, vector(moment)) for moment in moments]
    return [*turning, *((U[:, k], cross(axis(k), vd)) for k in range(3)), (vd, None)]


def axis(k: int) -> SX:
    """(3, 1) unit vector of a coordinate axis."""
    result = zeros()
    result[k] = 1
    return result


def work(twist: PathTwist, unit: Unit) -> SX:
    """Work of a wrench in a velocity, both about the origin of one frame and in it."""
    f, m = unit
    turning = SX(0) if m is None else SX(casadi.dot(twist.n, m))
    return turning if f is None else turning + casadi.dot(twist.t, f)


def element(twist: PathTwist, units: list[Unit], k: int) -> SX:
    """Work of the unit of parameter k."""
    return work(twist, units[k])
