"""A ball as the only unknown joint: the quaternion of a known orientation.

Of the four formulas the one with the largest denominator is taken, so that nothing is lost at half
turns; the quaternion is the one whose first element is not negative.

Source: Shepperd 1978.
"""

from __future__ import annotations

from functools import reduce

import casadi
from casadi import SX

from mbs.components.motion import Motion
from mbs.loops.closed_form.ring import Ring
from mbs.loops.closed_form.root import Root


def ball(ring: Ring, q: SX, p: SX) -> Root | None:
    """The orientation of a spherical joint of the tree; None unless it alone is unknown."""
    joint = ring.joints[0]
    if len(ring.joints) != 1 or joint.motion is not Motion.SPHERICAL or joint.place is None:
        return None
    R = ring.gaps[0].pose.R
    quaternion = unit_quaternion(R.T if joint.sign > 0 else R)
    return Root({"": {joint.place + k: quaternion[k] for k in range(4)}})


def unit_quaternion(R: SX) -> SX:
    """(4, 1) unit quaternion w, x, y, z of an orientation, w not negative."""
    a, b, c = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    d, e, f = R[1, 2] + R[2, 1], R[0, 2] + R[2, 0], R[0, 1] + R[1, 0]
    trace = casadi.trace(R)
    squares = [1 + trace, *(1 - trace + 2 * R[k, k] for k in range(3))]
    multiples = [
        casadi.vertcat(squares[0], a, b, c),
        casadi.vertcat(a, squares[1], f, e),
        casadi.vertcat(b, f, squares[2], d),
        casadi.vertcat(c, e, d, squares[3]),
    ]
    largest = reduce(casadi.fmax, squares)
    chosen = multiples[3]
    for square, multiple in zip(squares[2::-1], multiples[2::-1], strict=True):
        chosen = casadi.if_else(square >= largest, multiple, chosen)
    signed = casadi.if_else(chosen[0] < 0, -chosen, chosen)
    return SX(signed / casadi.norm_2(signed))
