"""Two turns whose axes meet, as in a universal joint, that aim a known point at a known point.

What the second turn can change along the axis of the first gives X cos t + Y sin t = Z. The sign
says to which side of the plane of the two axes the second joint is turned.

Source: Khalil & Creusot 1997, section 3.3, equation of type 2.
"""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.loops.closed_form.centre import Centre, centres
from mbs.loops.closed_form.ring import Ring
from mbs.loops.closed_form.root import Positions, Root, positions, signed
from mbs.loops.closed_form.trigonometry import across, in_plane, root_angle, turn_onto


def aim(ring: Ring, q: SX, p: SX) -> Root | None:
    """The two ways to aim a link at its other end; None unless two centres are all that is unknown.

    Args:
        ring: the loop, of which one centre is made of two turns.
        q: symbols of positions.
        p: symbols of parameters.
    """
    n = len(ring.joints)
    found = centres(ring, q, p)
    for one in found:
        for other in found:
            next_to = (one.first + one.count - other.first) % n == 0
            if one.count == 2 and next_to and other.count == n - 2:
                return _aimed(ring.rotated(one.first), one, other)
    return None


def _aimed(ring: Ring, one: Centre, other: Centre) -> Root:
    ways = signed(ring.joints[1])
    return Root({label: _way(ring, one, other, sign) for label, sign in ways})


def _way(ring: Ring, one: Centre, other: Centre, sign: int) -> Positions:
    X1, X2, X3 = (gap.pose for gap in ring.gaps[:3])
    back = X1.inverse()
    goal = back.p + back.R @ other.after - one.before
    arm, x = X3.p + X3.R @ other.before - one.after, X2.R[2, :].T
    dot = x[0] * arm[0] + x[1] * arm[1]
    b = root_angle(dot, -across(x, arm), goal[2] - x[2] * arm[2], sign)
    turned = casadi.vertcat(b.matrix @ in_plane(arm), arm[2])
    a = turn_onto(in_plane(X2.R @ turned), in_plane(goal))
    return positions(ring.joints[:2], (a.value, b.value))
