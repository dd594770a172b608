"""A planar loop with three unknown turns: the law of cosines at the one in the middle.

With g the way from the first axis to the third, d2 and d3 the links between, seen in the plane:
|d2 + R d3| = |g| is X cos t + Y sin t = Z in the middle angle t. The sign says to which side of the
stretched position the middle joint is turned.

Source: Khalil & Creusot 1997, section 3.3, equation of type 8.
"""

from __future__ import annotations

from mbs.loops.closed_form.ring import Ring
from mbs.loops.closed_form.root import Positions, Root, positions, signed
from mbs.loops.closed_form.trigonometry import (
    across,
    in_plane,
    last_angle,
    root_angle,
    square,
    turn_onto,
)


def three_turns(ring: Ring) -> Root:
    """The two ways to close a planar loop of three unknown turns.

    Args:
        ring: its joints a, b, c; b is the one in the middle, c may be spherical.
    """
    return Root({label: _way(ring, sign) for label, sign in signed(ring.joints[1])})


def _way(ring: Ring, sign: int) -> Positions:
    X1, X2, X3 = (gap.pose for gap in ring.gaps)
    g, d2, d3 = (in_plane(p) for p in (X1.inverse().p, X2.p, X3.p))
    R1, R2, R3 = (in_plane(pose.R) for pose in (X1, X2, X3))
    m = R2.T @ d2
    Z = (square(g) - square(m) - square(d3)) / 2
    b = root_angle(m.T @ d3, -across(m, d3), Z, sign)
    a = turn_onto(d2 + R2 @ (b.matrix @ d3), g)
    before = R1[0, :] @ a.matrix @ R2 @ b.matrix @ R3
    return positions(ring.joints, (a.value, b.value, last_angle(before)))
