"""Two turns whose axes meet, as in a universal joint, that aim a known point at a known point.

What the second turn can change along the axis of the first gives X cos t + Y sin t = Z. The sign
says to which side of the plane of the two axes the second joint is turned.

Source: Khalil & Creusot 1997, section 3.3, equation of type 2.
"""

from __future__ import annotations

import casadi

from mbs.loops.closed_form.ring import Ring
from mbs.loops.closed_form.root import Positions, Root, positions, signed
from mbs.loops.closed_form.survey import meeting_point
from mbs.loops.closed_form.trigonometry import across, in_plane, root_angle, turn_onto
from mbs.spatial import vector


def aim(ring: Ring) -> Root:
    """The two ways to aim a leg at its ball.

    Args:
        ring: the two turns, then the ball.
    """
    return Root({label: _way(ring, sign) for label, sign in signed(ring.joints[1])})


def _way(ring: Ring, sign: int) -> Positions:
    X1, X2, X3 = (gap.pose for gap in ring.gaps)
    first, second = (vector([0, 0, z]) for z in meeting_point(X2))
    goal, arm, x = X1.inverse().p - first, X3.p - second, X2.R[2, :].T
    dot = x[0] * arm[0] + x[1] * arm[1]
    b = root_angle(dot, -across(x, arm), goal[2] - x[2] * arm[2], sign)
    turned = casadi.vertcat(b.matrix @ in_plane(arm), arm[2])
    a = turn_onto(in_plane(X2.R @ turned), in_plane(goal))
    return positions(ring.joints[:2], (a.value, b.value))
