"""Stäubli TX90: shoulder offset, spherical wrist."""

from __future__ import annotations

from math import pi

from mbs.mechanism import Mechanism
from mbs.robots.rows import cuboid, degrees, frame, robot

_SOURCE = (
    "Geometry and joint ranges: Stäubli data sheet of the TX90, 50, 425, 425, 100 and 478 mm;"
    " masses and inertias are illustrative: homogeneous cuboids"
)


def tx90() -> Mechanism:
    """Stäubli TX90: six revolute joints q1 .. q6, with a spherical wrist.

    The upper arm is offset sideways by 50 mm. At zero the arm is upright, and frame 6, which is on
    the flange, has the orientation of the base.

    Source: lengths and joint ranges of the Stäubli data sheet of the TX90. Masses, inertias and
    rotors are illustrative.
    """
    half = pi / 2
    frames = [
        frame(0, r=0.478, limits=degrees(-180, 180)),
        frame(1, alpha=-half, d=0.05, theta=-half, limits=degrees(-130, 147.5)),
        frame(2, d=0.425, theta=half, r=0.05, limits=degrees(-145, 145)),
        frame(3, alpha=half, r=0.425, limits=degrees(-270, 270)),
        frame(4, alpha=-half, limits=degrees(-115, 140)),
        frame(5, alpha=half, r=0.1, limits=degrees(-270, 270)),
    ]
    bodies = [
        cuboid(1, 30, (0.3, 0.3, 0.3), (0.02, 0, -0.1), Ia=1.5),
        cuboid(2, 20, (0.6, 0.16, 0.14), (0.2, 0, 0.1), Ia=2.5),
        cuboid(3, 12, (0.2, 0.2, 0.2), (0, 0, 0.02), Ia=1.0),
        cuboid(4, 6, (0.14, 0.14, 0.35), (0, 0, -0.2), Ia=0.3),
        cuboid(5, 2, (0.1, 0.1, 0.12), (0, 0, 0.01), Ia=0.2),
        cuboid(6, 0.5, (0.06, 0.06, 0.05), (0, 0, -0.03), Ia=0.1),
    ]
    return robot("tx90", _SOURCE, frames, bodies)
