"""FANUC CRX-10iA: the axes of the wrist do not meet."""

from __future__ import annotations

from math import pi

from mbs.mechanism import Mechanism
from mbs.robots.rows import cuboid, degrees, frame, robot

_SOURCE = (
    "Geometry: FANUC data sheet of the CRX-10iA, 245, 540, 540, 150 and 160 mm; joint ranges: the"
    " description fanuc_crx_description of the maker; masses and inertias are illustrative:"
    " homogeneous cuboids"
)


def crx10() -> Mechanism:
    """FANUC CRX-10iA: six revolute joints q1 .. q6, without a spherical wrist.

    The last axis is 150 mm from the axis of the forearm. At zero the upper arm is upright and the
    forearm is along x of the base. q3 is the angle between upper arm and forearm. Frame 6 is on the
    flange, and its z axis points back into the arm.

    Source: lengths of the FANUC data sheet of the CRX-10iA; joint ranges of its description
    fanuc_crx_description. Masses, inertias and rotors are illustrative.
    """
    half = pi / 2
    frames = [
        frame(0, r=0.245, limits=degrees(-190, 190)),
        frame(1, alpha=-half, theta=-half, limits=degrees(-179.9, 179.9)),
        frame(2, alpha=pi, d=0.54, limits=degrees(-71, 251)),
        frame(3, alpha=-half, r=-0.54, limits=degrees(-190, 190)),
        frame(4, alpha=half, r=0.15, limits=degrees(-179.9, 179.9)),
        frame(5, alpha=-half, r=-0.16, limits=degrees(-225, 225)),
    ]
    bodies = [
        cuboid(1, 10, (0.18, 0.18, 0.2), (0, 0, -0.05), Ia=0.6),
        cuboid(2, 12, (0.6, 0.12, 0.12), (0.25, 0, 0), Ia=0.8),
        cuboid(3, 6, (0.15, 0.15, 0.15), (0, 0.02, 0), Ia=0.5),
        cuboid(4, 5, (0.1, 0.1, 0.4), (0, 0, 0.2), Ia=0.2),
        cuboid(5, 2, (0.1, 0.1, 0.16), (0, 0, -0.03), Ia=0.1),
        cuboid(6, 0.5, (0.08, 0.08, 0.06), (0, 0, 0.05), Ia=0.05),
    ]
    return robot("crx10", _SOURCE, frames, bodies)
