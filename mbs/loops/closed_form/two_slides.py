"""A planar loop with one unknown turn and two slides: the turn is what is missing, then linear.

Source: Khalil & Creusot 1997, section 3.3, equations of types 1 and 3.
"""

from __future__ import annotations

from mbs.loops.closed_form.ring import Ring
from mbs.loops.closed_form.root import Root, positions
from mbs.loops.closed_form.trigonometry import across, in_plane, last_angle


def two_slides(ring: Ring) -> Root:
    """The only way to close a planar loop of an unknown turn and two slides.

    Args:
        ring: its joints a, b, c; a is the turn.
    """
    X1, X2, X3 = (gap.pose for gap in ring.gaps)
    R = X2.R @ X3.R
    e, u, v = (in_plane(p) for p in (X2.p + X2.R @ X3.p + R @ X1.p, X2.R[:, 2], R[:, 2]))
    a, whole = last_angle(in_plane(R @ X1.R)), across(u, v)
    values = (a, -across(e, v) / whole, -across(u, e) / whole)
    return Root({"": positions(ring.joints, values)})
