"""A ball that two joints confine to a plane: a turn brings it there.

Two parallel turns, a turn and a slide across it, or two slides leave a point in a plane with the
normal n. A turn beyond them brings the ball into that plane: X cos t + Y sin t = Z. Then the loop
is plane.

Source: Khalil & Creusot 1997, section 3.3, equation of type 2.
"""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.components.motion import Motion
from mbs.loops.closed_form.centre import with_balls
from mbs.loops.closed_form.ring import Ring
from mbs.loops.closed_form.root import Root, positions, signed
from mbs.loops.closed_form.survey import always_zero, parallel
from mbs.loops.closed_form.trigonometry import across, in_plane, root_angle
from mbs.spatial import Pose, cross, vector

_Z = (0.0, 0.0, 1.0)


def confined(ring: Ring, q: SX, p: SX) -> Root | None:
    """The turn that brings a ball into the plane of two others; None where none does so.

    Args:
        ring: the loop, of which a ball and three joints are unknown.
        q: symbols of positions.
        p: symbols of parameters.
    """
    ring = with_balls(ring, q, p)
    balls = [k for k, joint in enumerate(ring.joints) if joint.motion is Motion.SPHERICAL]
    if len(balls) != 1 or len(ring.joints) != 4:
        return None
    begun = ring.rotated((balls[0] + 1) % 4)
    for way in (begun, begun.reversed().rotated(1)):
        if way.joints[0].turns:
            normal = _normal(way, q, p)
            if normal is not None and not _keeps(way, normal, q, p):
                return _brought(way, normal)
    return None


def _normal(ring: Ring, q: SX, p: SX) -> SX | None:
    """The normal of the plane that the second and third joint keep, seen before the second."""
    second, third = (joint.motion is Motion.PRISMATIC for joint in ring.joints[1:3])
    between = ring.gaps[2].pose
    axis = between.R[:, 2]
    if second and third:
        return cross(vector(_Z), axis)
    if second or third:
        across_it = always_zero(axis[2], q, p)
        return (axis if second else vector(_Z)) if across_it else None
    return vector(_Z) if parallel(between, q, p) else None


def _keeps(ring: Ring, normal: SX, q: SX, p: SX) -> bool:
    """Whether the first turn moves nothing along the normal either."""
    return always_zero(in_plane(ring.gaps[1].pose.R @ normal), q, p)


def _brought(ring: Ring, normal: SX) -> Root:
    """The first turn, from the ball seen before it and its place along the normal after it."""
    X1, X2, X3, X4 = (gap.pose for gap in ring.gaps)
    joint, goal = ring.joints[0], X1.inverse().p
    m = X2.R @ normal
    Z = casadi.dot(normal, (X3 @ Pose.moved(X4.p)).p) + casadi.dot(m, X2.p)
    X, Y = casadi.dot(in_plane(m), in_plane(goal)), across(in_plane(m), in_plane(goal))
    return Root(
        {
            label: positions([joint], [root_angle(X, Y, Z - m[2] * goal[2], sign).value])
            for label, sign in signed(joint)
        }
    )
