"""The arm of Manseur and Doty, which reaches a pose in sixteen configurations."""

from __future__ import annotations

from math import pi, radians

from mbs.mechanism import Mechanism
from mbs.robots.rows import cuboid, frame, robot

_SOURCE = (
    "Geometry: Manseur & Doty 1989, as varied by Wampler & Morgan 1991, problem 6, and printed by"
    " Manocha & Canny 1994, table I; masses and inertias are illustrative: homogeneous cuboids"
)


def manseur_doty() -> Mechanism:
    """Arm of Manseur and Doty: six revolute joints, up to sixteen real solutions.

    Some poses of the hand are reached in sixteen real configurations. Frame 6 is on the last joint.
    The last twist of the table, one degree about its x axis, belongs to the hand and is left out.

    Source: Manocha & Canny 1994, table I, the example of Wampler & Morgan 1991 after Manseur & Doty
    1989, as modified parameters. Masses and inertias are illustrative.
    """
    half, twist = pi / 2, radians(1)
    frames = [
        frame(0),
        frame(1, alpha=half, d=0.3),
        frame(2, alpha=twist, d=1, r=0.2),
        frame(3, alpha=half),
        frame(4, alpha=twist, d=1.5),
        frame(5, alpha=half),
    ]
    bodies = [
        cuboid(1, 10, (0.4, 0.2, 0.2), (0.15, 0, 0), Ia=0.5),
        cuboid(2, 8, (1.1, 0.15, 0.15), (0.5, 0, 0), Ia=0.5),
        cuboid(3, 4, (0.15, 0.15, 0.2), (0, 0, 0.05), Ia=0.3),
        cuboid(4, 6, (1.6, 0.12, 0.12), (0.75, 0, 0), Ia=0.3),
        cuboid(5, 1, (0.1, 0.1, 0.1), (0, 0, 0), Ia=0.1),
        cuboid(6, 0.5, (0.06, 0.06, 0.1), (0, 0, 0.05), Ia=0.05),
    ]
    return robot("manseur_doty", _SOURCE, frames, bodies)
