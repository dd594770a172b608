"""One joint that brings two points to a known distance: rods, and legs on universal joints.

Seen from the joint, one point is at m, the other one at d beyond the joint. A turn gives
X cos t + Y sin t = Z, a slide a quadratic equation.

Source: Khalil & Creusot 1997, section 3.3, equation of type 2.
"""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.loops.closed_form.ring import Ring, Unknown
from mbs.loops.closed_form.root import Root, positions, signed
from mbs.loops.closed_form.survey import meeting_point
from mbs.loops.closed_form.trigonometry import across, root_angle, square
from mbs.spatial import vector


def rod(ring: Ring) -> Root:
    """The two ways to place a joint so that a rod fits.

    Args:
        ring: the joint, then the two balls of the rod.
    """
    X1, X2, X3 = (gap.pose for gap in ring.gaps)
    return _at_distance(ring.joints[0], -X1.inverse().p, X2.p, square(X3.p))


def leg(ring: Ring) -> Root:
    """The two ways to place the third joint of a leg that ends in a ball.

    Args:
        ring: two turns whose axes meet, the joint, and the ball.
    """
    X1, X2, X3, X4 = (gap.pose for gap in ring.gaps)
    first, second = (vector([0, 0, z]) for z in meeting_point(X2))
    m = X3.R.T @ (X3.p - second)
    return _at_distance(ring.joints[2], m, X4.p, square(X1.inverse().p - first))


def _at_distance(joint: Unknown, m: SX, d: SX, squared: SX) -> Root:
    """The two positions of a joint at which m and d beyond it are as far apart as told."""

    def value(sign: int) -> SX:
        if joint.turns:
            Z = (squared - square(m) - square(d)) / 2 - m[2] * d[2]
            return root_angle(m[0] * d[0] + m[1] * d[1], -across(m, d), Z, sign).value
        w = m + d
        return SX(sign * casadi.sqrt(squared - w[0] * w[0] - w[1] * w[1]) - w[2])

    return Root({label: positions([joint], (value(sign),)) for label, sign in signed(joint)})
