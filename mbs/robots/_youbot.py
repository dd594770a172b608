"""KUKA youBot arm: five revolute joints."""

from __future__ import annotations

from math import pi

from mbs.mechanism import Mechanism
from mbs.robots.rows import cuboid, degrees, frame, robot

_SOURCE = (
    "Geometry and joint ranges: joint origins of the maker's description youbot_description; masses"
    " and inertias are illustrative: homogeneous cuboids"
)


def youbot() -> Mechanism:
    """KUKA youBot arm: five revolute joints q1 .. q5, axes 2, 3 and 4 parallel.

    With five joints it reaches only a five-dimensional set of poses. At zero the arm is upright,
    with the axes of q1 and q5 pointing upwards. The base frame is below axis 1; frame 5 is on the
    last joint.

    Source: joint origins and ranges of youbot_description, measured from the upright configuration.
    Masses, inertias and rotors are illustrative.
    """
    half = pi / 2
    frames = [
        frame(0, r=0.115, limits=degrees(-169, 169)),
        frame(1, alpha=-half, d=0.033, theta=-half, limits=degrees(-65, 90)),
        frame(2, d=0.155, limits=degrees(-151, 146)),
        frame(3, d=0.135, theta=half, limits=degrees(-102.5, 102.5)),
        frame(4, alpha=half, d=-0.002, r=0.13, limits=degrees(-167.5, 167.5)),
    ]
    bodies = [
        cuboid(1, 1.4, (0.1, 0.1, 0.06), (0.01, 0, -0.02), Ia=0.1),
        cuboid(2, 1.3, (0.2, 0.07, 0.08), (0.1, 0, -0.02), Ia=0.1),
        cuboid(3, 0.8, (0.18, 0.06, 0.06), (0.09, 0, 0.02), Ia=0.08),
        cuboid(4, 0.8, (0.06, 0.1, 0.06), (0, -0.04, 0), Ia=0.05),
        cuboid(5, 0.2, (0.06, 0.06, 0.03), (0, 0, -0.02), Ia=0.03),
    ]
    return robot("youbot", _SOURCE, frames, bodies)
