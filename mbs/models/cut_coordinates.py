"""Coordinates of cut joints, which are not in q, and their rates."""

from __future__ import annotations

import casadi
from casadi import DM, SX

from mbs.assembly import System
from mbs.assembly.khalil_frames import Cut
from mbs.components import Universal
from mbs.components.axes import in_plane
from mbs.components.motion import Motion
from mbs.loops.velocity import acceleration_bias
from mbs.models.loop_kinematics import cut_velocities
from mbs.models.symbols import ModelSymbols
from mbs.recursions.route import relative_pose
from mbs.spatial import Pose, cross


def cut_coordinate(system: System, s: ModelSymbols, a: SX, name: str) -> tuple[SX, SX, SX]:
    """Position, velocity and acceleration of a coordinate of a cut joint.

    Angles are between -pi and pi.

    Args:
        system: with closed loops.
        s: its symbols; the positions close the loops.
        a: (nv, 1) accelerations of the tree.
        name: of a displacement or angle in `system.cut_coordinates`.
    """
    row = next(row for row in system.cut_coordinates if row.name == name)
    cut = next(cut for cut in system.cuts if cut.edge.joint.name == row.joint)
    freedoms = cut.edge.joint.freedoms
    number = [freedom.coordinate_of(row.joint) for freedom in freedoms].index(name)
    pose = relative_pose(system.tree, s.q, *cut.frames)
    C = cut_velocities(system, s.q, cut)[number, :]
    speed = SX.sym("v", system.nv)
    bias = casadi.substitute(acceleration_bias(system, s.q, speed, C), speed, s.v_tree)
    value = _position(cut, number, pose)
    return value, casadi.mtimes(C, s.v_tree), casadi.mtimes(C, a) + bias


def _position(cut: Cut, number: int, pose: Pose) -> SX:
    """A freedom read from frame_b seen from frame_a.

    A turn of a universal joint leaves the axis of the other one in its place.
    """
    joint = cut.edge.joint
    freedom = joint.freedoms[number]
    axis = SX(DM(list(freedom.axis)))
    if freedom.motion is Motion.PRISMATIC:
        return casadi.dot(axis, pose.p)
    if isinstance(joint, Universal):
        other = SX(DM(list(joint.freedoms[1 - number].axis)))
        if number == 0:
            return _angle(axis, other, casadi.mtimes(pose.R, other))
        return -_angle(axis, other, casadi.mtimes(pose.R.T, other))
    start = SX(DM(list(in_plane(freedom.axis)[0])))
    return _angle(axis, start, casadi.mtimes(pose.R, start))


def _angle(axis: SX, start: SX, end: SX) -> SX:
    """The turn about an axis that takes one direction across it to another one [rad]."""
    return casadi.atan2(casadi.dot(cross(axis, start), end), casadi.dot(start, end))
