"""Two bars in a vertical plane: the smallest robot with all terms in its model."""

from __future__ import annotations

from mbs.mechanism import Mechanism
from mbs.robots.rows import cuboid, frame, robot

_SOURCE = "Textbook arm; lengths, masses and inertias are illustrative"


def planar_2r() -> Mechanism:
    """Planar arm (double pendulum with motors): revolute joints q1 and q2 about z.

    Gravity is along -y, and both bars are along x at zero. The bars are homogeneous, of 1 m length,
    1 kg mass and 0.05 m thickness. All values are illustrative.
    """
    frames = [frame(0), frame(1, d=1)]
    bodies = [cuboid(j, 1, (1, 0.05, 0.05), (0.5, 0, 0)) for j in (1, 2)]
    return robot("planar_2r", _SOURCE, frames, bodies, gravity=[0, -9.81, 0])
