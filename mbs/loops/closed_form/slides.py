"""Slides alone, or with all turns about one point: linear equations.

X_1 .. X_n with the slides at zero leaves a gap e; the slides move along u_1 .. u_m, m <= 3, and
e + u_1 s_1 + .. + u_m s_m = 0. With fewer than three the normal equations are solved, which lose
nothing where the loop closes.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi
from casadi import SX

from mbs.components.motion import Motion
from mbs.loops.closed_form.centre import Centre, centres
from mbs.loops.closed_form.ring import Ring
from mbs.loops.closed_form.root import Root, positions
from mbs.spatial import Pose, cross, vector

_MOST = 3


def slides(ring: Ring, q: SX, p: SX) -> Root | None:
    """The only displacements that close a loop; None where a turn has a say in them."""
    number = sum(joint.motion is Motion.PRISMATIC for joint in ring.joints)
    if not 1 <= number <= _MOST:
        return None
    if number == len(ring.joints):
        nowhere = Centre(0, 0, vector([0, 0, 0]), vector([0, 0, 0]))
        return _slid(ring, nowhere)
    for centre in centres(ring, q, p):
        if centre.count + number == len(ring.joints):
            return _slid(ring.rotated(centre.first), centre)
    return None


def _slid(ring: Ring, centre: Centre) -> Root:
    """The slides that lead from the centre, the first one of the loop, back to it."""
    joints = ring.joints[centre.count :]
    pose, axes = Pose.moved(-centre.after), list[SX]()
    for gap in ring.gaps[centre.count :]:
        pose = pose @ gap.pose
        axes.append(pose.R[:, 2])
    if centre.count:
        pose = pose @ ring.gaps[0].pose
    e = pose.p + pose.R @ centre.before
    return Root({"": positions(joints, _solved(axes, -e))})


def _solved(u: Sequence[SX], e: SX) -> list[SX]:
    """The combination of one to three vectors that gives e."""
    if len(u) == 1:
        return [casadi.dot(u[0], e) / casadi.sumsqr(u[0])]
    if len(u) == 2:
        n = cross(u[0], u[1])
        size = casadi.sumsqr(n)
        return [casadi.dot(cross(e, u[1]), n) / size, casadi.dot(cross(u[0], e), n) / size]
    across = [cross(u[1], u[2]), cross(u[2], u[0]), cross(u[0], u[1])]
    volume = casadi.dot(u[0], across[0])
    return [casadi.dot(e, normal) / volume for normal in across]
