"""Universal Robots UR5: three parallel axes, no spherical wrist."""

from __future__ import annotations

from math import pi

from mbs.mechanism import Mechanism
from mbs.robots.rows import cuboid, frame, robot

_SOURCE = (
    "Geometry and joint ranges: Universal Robots, Denavit-Hartenberg parameters of the UR5; masses"
    " and inertias are illustrative: homogeneous cuboids"
)
_TURNS = [-2 * pi, 2 * pi]


def ur5() -> Mechanism:
    """Universal Robots UR5: six revolute joints q1 .. q6, without a spherical wrist.

    The axes 2, 3 and 4 are parallel. At zero the arm is stretched along -x of the base. Frame 6 is
    on the flange.

    Source: Denavit-Hartenberg parameters published by Universal Robots for the UR5, as modified
    parameters. Masses, inertias and rotors are illustrative.
    """
    half = pi / 2
    frames = [
        frame(0, r=0.089159, limits=_TURNS),
        frame(1, alpha=half, limits=_TURNS),
        frame(2, d=-0.425, limits=_TURNS),
        frame(3, d=-0.39225, r=0.10915, limits=_TURNS),
        frame(4, alpha=half, r=0.09465, limits=_TURNS),
        frame(5, alpha=-half, r=0.0823, limits=_TURNS),
    ]
    bodies = [
        cuboid(1, 3.7, (0.12, 0.12, 0.15), (0, 0, 0), Ia=0.5),
        cuboid(2, 8.4, (0.5, 0.1, 0.1), (-0.21, 0, 0.11), Ia=0.5),
        cuboid(3, 2.3, (0.45, 0.08, 0.08), (-0.2, 0, 0.02), Ia=0.3),
        cuboid(4, 1.2, (0.07, 0.07, 0.1), (0, 0, -0.02), Ia=0.1),
        cuboid(5, 1.2, (0.07, 0.07, 0.1), (0, 0, -0.02), Ia=0.1),
        cuboid(6, 0.2, (0.06, 0.06, 0.04), (0, 0, -0.02), Ia=0.05),
    ]
    return robot("ur5", _SOURCE, frames, bodies)
