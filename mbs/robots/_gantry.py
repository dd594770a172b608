"""A gantry robot: three prismatic joints and a spherical wrist."""

from __future__ import annotations

from math import pi

from mbs.mechanism import Mechanism
from mbs.robots.rows import cuboid, frame, robot

_SOURCE = "Illustrative gantry: dimensions, masses and inertias are invented"


def gantry() -> Mechanism:
    """Gantry robot: prismatic joints q1, q2, q3, and a spherical wrist q4, q5, q6.

    q1, q2 and q3 move along x, along y and downwards. Frame 6 is 120 mm below the centre of the
    wrist, with its z axis downwards at zero. All values are illustrative.
    """
    half = pi / 2
    frames = [
        frame(0, "prismatic", gamma=half, alpha=half, theta=half, limits=[0, 3]),
        frame(1, "prismatic", alpha=half, theta=half, limits=[0, 2]),
        frame(2, "prismatic", alpha=-half, r=-1.5, limits=[0, 1]),
        frame(3, limits=[-pi, pi]),
        frame(4, alpha=half, limits=[-2, 2]),
        frame(5, alpha=-half, r=0.12, limits=[-pi, pi]),
    ]
    bodies = [
        cuboid(1, 60, (0.2, 2, 0.2), (0, -1, 0), Ia=20),
        cuboid(2, 25, (0.3, 0.3, 0.3), (0, 0, 0), Ia=10),
        cuboid(3, 10, (0.1, 0.1, 1.2), (0, 0, -0.6), Ia=10),
        cuboid(4, 3, (0.1, 0.1, 0.12), (0, 0, -0.08), Ia=0.2),
        cuboid(5, 1.5, (0.08, 0.08, 0.08), (0, 0, 0), Ia=0.1),
        cuboid(6, 0.5, (0.06, 0.06, 0.05), (0, 0, -0.03), Ia=0.05),
    ]
    return robot("gantry", _SOURCE, frames, bodies)
