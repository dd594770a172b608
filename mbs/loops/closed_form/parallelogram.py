"""A planar loop of equal opposite sides: the parallelogram, and its mirror image that crosses.

The known way g from the first axis to the third one runs over an axis that splits it into P and Q,
as long as the two unknown links, B and A. One solution is A = Q, B = P, whatever the position; the
other one is its mirror image about g. Told apart by this and not by a side, either keeps its
label through the flat position, where they meet.
"""

from __future__ import annotations

from casadi import SX

from mbs.loops.closed_form.ring import Ring
from mbs.loops.closed_form.root import Positions, Root, positions
from mbs.loops.closed_form.trigonometry import in_plane, last_angle, square, turn_onto


def parallelogram(ring: Ring, pivot: int) -> Root:
    """The two ways to close a loop that can be a parallelogram.

    Args:
        ring: its joints a, b, c; b is opposite to the known axis.
        pivot: which known axis of the way from c to a that is.
    """
    name = ring.joints[1].name
    X1 = ring.gaps[0].pose
    back = X1.inverse()
    g = in_plane(back.p)
    Q = g - in_plane((back @ ring.gaps[0].pivots[pivot]).p)
    mirrored = g * (2 * (Q.T @ g) / square(g)) - Q
    return Root(
        {
            f"{name}:parallel": _way(ring, Q, g - Q),
            f"{name}:crossed": _way(ring, mirrored, g - mirrored),
        }
    )


def _way(ring: Ring, A: SX, B: SX) -> Positions:
    """Positions with the first link along A and the second along B, both seen before joint a."""
    X1, X2, X3 = (gap.pose for gap in ring.gaps)
    R1, R2, R3 = (in_plane(pose.R) for pose in (X1, X2, X3))
    a = turn_onto(in_plane(X2.p), A)
    b = turn_onto(in_plane(X3.p), R2.T @ (a.matrix.T @ B))
    before = R1[0, :] @ a.matrix @ R2 @ b.matrix @ R3
    return positions(ring.joints, (a.value, b.value, last_angle(before)))
