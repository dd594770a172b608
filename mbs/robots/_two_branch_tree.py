"""A trunk with two arms: frames that need the branch parameters gamma and b."""

from __future__ import annotations

from math import pi

from mbs.mechanism import Mechanism
from mbs.robots.rows import cuboid, frame, robot

_SOURCE = "Illustrative tree: dimensions, masses and inertias are invented"


def two_branch_tree() -> Mechanism:
    """Rotating trunk q1 with two arms: q2 .. q4, and q5 .. q7.

    Joint q4, the last of the first arm, is prismatic; the others are revolute. All values are
    illustrative.
    """
    half = pi / 2
    frames = [
        frame(0, r=0.5),
        frame(1, gamma=0.4, b=0.3, alpha=half, d=0.2),
        frame(2, d=0.35, alpha=-half),
        frame(3, "prismatic", alpha=half, r=0.1),
        frame(1, gamma=-0.4, b=0.3, alpha=half, d=0.2),
        frame(5, d=0.35, r=0.05),
        frame(6, alpha=-half, d=0.3),
    ]
    arms = [
        cuboid(number, 3 - 0.5 * k, (0.3, 0.08, 0.08), (0.15, 0.01, -0.02), Ia=0.1)
        for k, number in enumerate((2, 3))
    ]
    bodies = [
        cuboid(1, 10, (0.3, 0.5, 0.3), (0, 0, 0.1), Ia=0.5),
        *arms,
        cuboid(4, 1, (0.06, 0.06, 0.3), (0, 0.01, 0.15), Ia=0.5),
        cuboid(5, 3, (0.3, 0.08, 0.08), (0.15, -0.01, 0.02), Ia=0.1),
        cuboid(6, 2, (0.3, 0.06, 0.06), (0.15, 0, 0.01), Ia=0.1),
        cuboid(7, 0.5, (0.1, 0.05, 0.05), (0.05, 0, 0), Ia=0.05),
    ]
    return robot("two_branch_tree", _SOURCE, frames, bodies)
