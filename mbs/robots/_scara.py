"""A SCARA robot: three vertical revolute joints and a vertical prismatic one."""

from __future__ import annotations

from mbs.mechanism import Mechanism
from mbs.robots.rows import cuboid, frame, robot

_SOURCE = (
    "Structure: Khalil & Dombre 2002, SCARA example; lengths 0.425 and 0.375 m of an AdeptOne;"
    " masses and inertias are illustrative: homogeneous cuboids"
)


def scara() -> Mechanism:
    """SCARA robot: revolute joints q1, q2, q3 and prismatic joint q4, all vertical.

    A positive q4 moves upwards.

    Source: frames of the SCARA example of Khalil & Dombre 2002, lengths of the AdeptOne (Adept data
    sheet: 425 mm and 375 mm). Masses, inertias and rotors are illustrative.
    """
    frames = [
        frame(0),
        frame(1, d=0.425),
        frame(2, d=0.375),
        frame(3, "prismatic", limits=[-0.2, 0]),
    ]
    bodies = [
        cuboid(1, 15, (0.5, 0.15, 0.15), (0.2, 0, 0.1), Ia=1.2),
        cuboid(2, 12, (0.45, 0.15, 0.2), (0.15, 0, -0.05), Ia=0.4),
        cuboid(3, 1, (0.06, 0.06, 0.1), (0, 0, 0.02), Ia=0.03),
        cuboid(4, 1.5, (0.03, 0.03, 0.4), (0, 0, -0.1), Ia=2.0),
    ]
    return robot("scara", _SOURCE, frames, bodies)
