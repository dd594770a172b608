"""A planar loop with two unknown turns and a slide: a quadratic equation in the displacement.

Seen from the first axis, the third one moves along a line e + r u; its distance is that of the
known way g: r = -u.e +- sqrt(g^2 - (u x e)^2). The sign says which end of the stroke it is.

Source: Khalil & Creusot 1997, section 3.3, equations of types 2 and 4.
"""

from __future__ import annotations

import casadi

from mbs.loops.closed_form.ring import Ring
from mbs.loops.closed_form.root import Positions, Root, positions, signed
from mbs.loops.closed_form.trigonometry import across, in_plane, last_angle, square, turn_onto


def one_slide(ring: Ring) -> Root:
    """The two ways to close a planar loop of two unknown turns with a slide between them.

    Args:
        ring: its joints a, b, c; b is the slide, c may be spherical.
    """
    return Root({label: _way(ring, sign) for label, sign in signed(ring.joints[1])})


def _way(ring: Ring, sign: int) -> Positions:
    X1, X2, X3 = (gap.pose for gap in ring.gaps)
    R = X2.R @ X3.R
    g, e, u = (in_plane(p) for p in (X1.inverse().p, X2.p + X2.R @ X3.p, X2.R[:, 2]))
    r = sign * casadi.sqrt(square(g) - across(u, e) ** 2) - u.T @ e
    a = turn_onto(e + u * r, g)
    before = in_plane(X1.R)[0, :] @ a.matrix @ in_plane(R)
    return positions(ring.joints, (a.value, r, last_angle(before)))
