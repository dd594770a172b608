"""Three unknown turns from orientations alone.

R_a X_2 R_b X_3 R_c = X_1': the element on the third row and column holds the middle angle alone,
X cos t + Y sin t = Z. The sign says to which side of the plane of the two other axes the middle
joint is turned.

Source: Khalil & Creusot 1997, section 3.3, equation of type 2.
"""

from __future__ import annotations

import casadi

from mbs.loops.closed_form.ring import Ring
from mbs.loops.closed_form.root import Positions, Root, positions, signed
from mbs.loops.closed_form.trigonometry import Angle, across, in_plane, root_angle, turn_onto


def sphere(ring: Ring) -> Root:
    """The two ways to close a loop of three unknown turns, as far as orientations go.

    Args:
        ring: its joints a, b, c; b is the one in the middle.
    """
    return Root({label: _way(ring, sign) for label, sign in signed(ring.joints[1])})


def _way(ring: Ring, sign: int) -> Positions:
    R1, R2, R3 = (gap.pose.R for gap in ring.gaps)
    x, y = R2[2, :].T, R3[:, 2]
    dot = x[0] * y[0] + x[1] * y[1]
    b = root_angle(dot, -across(x, y), R1[2, 2] - x[2] * y[2], sign)
    turned = casadi.vertcat(b.matrix @ in_plane(y), y[2])
    a = turn_onto(in_plane(R2 @ turned), R1[2, 0:2].T)
    row = casadi.vertcat(b.matrix.T @ in_plane(x), x[2])
    c: Angle = turn_onto(in_plane(R1[:, 2]), in_plane(R3.T @ row))
    return positions(ring.joints, (a.value, b.value, c.value))
