"""Stäubli RX90: the worked example of Khalil & Dombre."""

from __future__ import annotations

from math import pi

from mbs.mechanism import Mechanism
from mbs.robots.rows import cuboid, frame, robot

_SOURCE = (
    "Geometry: Khalil & Dombre 2002, table 3.1, with D3 = RL4 = 0.45 m; masses, inertias and"
    " friction are illustrative: homogeneous cuboids"
)


def rx90() -> Mechanism:
    """Stäubli RX90: six revolute joints q1 .. q6, with a spherical wrist.

    Source: geometry of Khalil & Dombre 2002, table 3.1, D3 = RL4 = 0.45 m. No complete inertial
    data are published, since only base parameters can be identified. Masses, inertias, rotors and
    friction are illustrative: those of homogeneous cuboids of the size of the links.
    """
    half = pi / 2
    frames = [
        frame(0),
        frame(1, alpha=half),
        frame(2, d=0.45),
        frame(3, alpha=-half, r=0.45),
        frame(4, alpha=half),
        frame(5, alpha=-half),
    ]
    bodies = [
        cuboid(1, 30, (0.25, 0.25, 0.4), (0.02, 0.03, -0.1), Ia=1.5, Fv=20, Fs=10),
        cuboid(2, 20, (0.6, 0.16, 0.14), (0.2, 0.01, 0.1), Ia=2.5, Fv=25, Fs=12),
        cuboid(3, 12, (0.18, 0.25, 0.18), (0, 0.05, -0.02), Ia=1.0, Fv=10, Fs=8),
        cuboid(4, 6, (0.14, 0.14, 0.35), (0, 0.005, -0.18), Ia=0.3, Fv=3, Fs=3),
        cuboid(5, 2, (0.1, 0.12, 0.1), (0, 0.01, 0), Ia=0.2, Fv=2, Fs=2),
        cuboid(6, 0.5, (0.06, 0.06, 0.05), (0, 0, 0.08), Ia=0.1, Fv=1, Fs=1),
    ]
    return robot("rx90", _SOURCE, frames, bodies)
