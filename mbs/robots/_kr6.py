"""KUKA KR 6 R900 sixx: spherical wrist, forearm aside."""

from __future__ import annotations

from math import pi

from mbs.mechanism import Mechanism
from mbs.robots.rows import cuboid, degrees, frame, robot

_SOURCE = (
    "Geometry and joint ranges: KUKA data sheet of the KR 6 R900 sixx, 400, 25, 455, 35, 420 and 80"
    " mm; masses and inertias are illustrative: homogeneous cuboids"
)


def kr6() -> Mechanism:
    """KUKA KR 6 R900 sixx: six revolute joints q1 .. q6, with a spherical wrist.

    Signs and zeros of the joints are those of the manufacturer: at zero the arm is stretched along
    x of the base. Frame 6 is on the flange, and its z axis points back into the arm.

    Source: lengths and joint ranges of the KUKA data sheet of the KR 6 R900 sixx. Masses, inertias
    and rotors are illustrative.
    """
    half = pi / 2
    frames = [
        frame(0, alpha=pi, r=-0.4, limits=degrees(-170, 170)),
        frame(1, alpha=half, d=0.025, limits=degrees(-190, 45)),
        frame(2, d=0.455, theta=-half, limits=degrees(-120, 156)),
        frame(3, alpha=half, d=0.035, r=-0.42, limits=degrees(-185, 185)),
        frame(4, alpha=-half, limits=degrees(-120, 120)),
        frame(5, alpha=half, r=-0.08, limits=degrees(-350, 350)),
    ]
    bodies = [
        cuboid(1, 20, (0.25, 0.25, 0.3), (0, 0, 0.1), Ia=0.8),
        cuboid(2, 12, (0.55, 0.12, 0.12), (0.2, 0, 0.02), Ia=1.2),
        cuboid(3, 6, (0.16, 0.2, 0.14), (0.02, 0.03, 0), Ia=0.5),
        cuboid(4, 4, (0.1, 0.1, 0.3), (0, 0, 0.15), Ia=0.15),
        cuboid(5, 1.2, (0.08, 0.1, 0.08), (0, 0, 0), Ia=0.1),
        cuboid(6, 0.3, (0.05, 0.05, 0.04), (0, 0, 0.03), Ia=0.05),
    ]
    return robot("kr6", _SOURCE, frames, bodies)
