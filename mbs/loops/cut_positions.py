"""Positions of cut joints, computed from the two frames at each cut."""

from __future__ import annotations

import casadi
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.assembly.khalil_frames import Cut
from mbs.closed_forms.spatial import unit_quaternion
from mbs.components import Universal
from mbs.components.component import in_plane
from mbs.components.joints import Motion
from mbs.numbers import OnArrays, on_arrays
from mbs.recursions.route import relative_pose
from mbs.spatial import Pose, cross


def cut_positions(system: System) -> Function:
    """Return ``cut_positions(q, p) -> c``: positions of cut joints [rad, m, quaternion].

    Args:
        system: mechanism with loops.

    Returns:
        Function of q (nq, 1) and p (np, 1). The order of c is that of `system.cut_coordinates`.
        Angles are between -pi and pi. The first element of a quaternion is not negative.
    """

    def build() -> Function:
        q = SX.sym("q", system.nq)
        found = [SX(0, 1)]
        for cut in system.cuts:
            joint = cut.edge.joint
            if not cut.welded:
                pose = relative_pose(system.tree, q, *cut.frames)
                for number, freedom in enumerate(joint.freedoms):
                    match freedom.motion:
                        case Motion.FREE:
                            found += [pose.p, unit_quaternion(pose.R)]
                        case Motion.SPHERICAL:
                            found.append(unit_quaternion(pose.R))
                        case _:
                            found.append(cut_position(cut, number, pose))
        outputs = [casadi.densify(casadi.vertcat(*found))]
        return Function("cut_positions", [q, system.p], outputs, ["q", "p"], ["c"])

    function: Function = system.cached("cut positions", build)
    return function


def cut_positions_and_slopes(system: System) -> OnArrays:
    """Return ``(q, p) -> c, s`` of arrays: positions (c,) of cut joints, and derivative (c, nq).

    Args:
        system: mechanism with loops.
    """

    def build() -> OnArrays:
        q, p = SX.sym("q", system.nq), SX.sym("p", system.p.numel())
        found = cut_positions(system)(q, p)
        slopes = casadi.densify(casadi.jacobian(found, q))
        return on_arrays(Function("cut_slopes", [q, p], [found, slopes]))

    function: OnArrays = system.cached("slopes of cut positions", build)
    return function


def cut_position(cut: Cut, number: int, pose: Pose) -> SX:
    """Return the position of a single freedom of a cut joint [rad or m].

    Args:
        cut: cut joint.
        number: index of the freedom in the joint.
        pose: pose of frame_b of the joint relative to frame_a.
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
    """Return the angle [rad] about the unit vector `axis` from `start` to `end`, normal to it."""
    return casadi.atan2(casadi.dot(cross(axis, start), end), casadi.dot(start, end))
