"""A rod between two balls as all that is unknown: aimed the shortest way, and turned about itself.

The ball turns the vector u of the rod onto the known vector w. From the orientation R_0 of the
assembled posture the shortest turn M leads R_0 u onto w; before both the rod may spin about u.
"""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.components.motion import Motion
from mbs.loops.closed_form.centre import with_balls
from mbs.loops.closed_form.ring import Ring, Unknown
from mbs.loops.closed_form.root import Root, Spun
from mbs.spatial import cross, quaternion_rotation


def spin(ring: Ring, q: SX, p: SX) -> Root | None:
    """The orientation of a rod that spins; None unless it and another ball are all that is unknown.

    Args:
        ring: the loop.
        q: symbols of positions, that of the spin included.
        p: symbols of parameters.
    """
    ring = with_balls(ring, q, p)
    for first, joint in enumerate(ring.joints):
        balls = all(other.motion is Motion.SPHERICAL for other in ring.joints)
        if balls and len(ring.joints) == 2 and joint.spin is not None:
            return _aimed(ring.rotated(first), joint, q)
    return None


def _aimed(ring: Ring, joint: Unknown, q: SX) -> Root:
    before, after = ring.gaps[0].pose.inverse().p, ring.gaps[1].pose.p
    u, w = (after, before) if joint.sign > 0 else (before, after)
    u, w = u / casadi.norm_2(u), w / casadi.norm_2(w)
    assert joint.spin is not None
    assert joint.place is not None
    rest = SX(casadi.DM(list(joint.spin.rest)))
    shortest = _product(_shortest(quaternion_rotation(rest) @ u, w), rest)
    half = q[joint.spin.place] / 2
    turned = _product(shortest, casadi.vertcat(casadi.cos(half), casadi.sin(half) * u))
    turned = casadi.if_else(turned[0] < 0, -turned, turned)
    way = {joint.place + k: turned[k] for k in range(4)}
    given = q[joint.place : joint.place + 4]
    left = _product(casadi.vertcat(shortest[0], -shortest[1:4]), given)
    angle = 2 * casadi.atan2(casadi.dot(u, left[1:4]), left[0])
    return Root({"": way}, Spun(joint.spin.place, SX(angle)))


def _shortest(a: SX, b: SX) -> SX:
    """The quaternion that turns the unit vector a onto b about their common normal."""
    whole = casadi.vertcat(1 + casadi.dot(a, b), cross(a, b))
    return SX(whole / casadi.norm_2(whole))


def _product(a: SX, b: SX) -> SX:
    """The product of two quaternions w, x, y, z."""
    vector = a[0] * b[1:4] + b[0] * a[1:4] + cross(a[1:4], b[1:4])
    return casadi.vertcat(a[0] * b[0] - casadi.dot(a[1:4], b[1:4]), vector)
