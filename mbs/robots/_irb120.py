"""ABB IRB 120: spherical wrist, forearm aside."""

from __future__ import annotations

from math import pi

from mbs.mechanism import Mechanism
from mbs.robots.rows import cuboid, degrees, frame, robot

_SOURCE = (
    "Geometry and joint ranges: ABB product specification of the IRB 120-3/0.6, 290, 270, 70, 302"
    " and 72 mm; masses and inertias are illustrative: homogeneous cuboids"
)


def irb120() -> Mechanism:
    """ABB IRB 120: six revolute joints q1 .. q6, with a spherical wrist.

    Signs and zeros of the joints are those of the manufacturer: at zero the upper arm is upright
    and the forearm is along x of the base. Frame 6 is on the flange.

    Source: lengths and joint ranges of the ABB product specification of the IRB 120-3/0.6. Masses,
    inertias and rotors are illustrative.
    """
    half = pi / 2
    frames = [
        frame(0, r=0.29, limits=degrees(-165, 165)),
        frame(1, alpha=-half, theta=-half, limits=degrees(-110, 110)),
        frame(2, d=0.27, limits=degrees(-110, 70)),
        frame(3, alpha=-half, d=0.07, r=0.302, limits=degrees(-160, 160)),
        frame(4, alpha=half, limits=degrees(-120, 120)),
        frame(5, alpha=-half, r=0.072, limits=degrees(-400, 400)),
    ]
    bodies = [
        cuboid(1, 8, (0.18, 0.18, 0.25), (0, 0, -0.05), Ia=0.4),
        cuboid(2, 5, (0.35, 0.1, 0.12), (0.12, 0, 0), Ia=0.6),
        cuboid(3, 4, (0.15, 0.18, 0.12), (0.04, 0.03, 0), Ia=0.3),
        cuboid(4, 2.5, (0.08, 0.08, 0.2), (0, 0, -0.1), Ia=0.1),
        cuboid(5, 0.7, (0.06, 0.08, 0.06), (0, 0, 0), Ia=0.05),
        cuboid(6, 0.15, (0.04, 0.04, 0.03), (0, 0, -0.02), Ia=0.02),
    ]
    return robot("irb120", _SOURCE, frames, bodies)
