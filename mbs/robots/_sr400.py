"""SR400: six joints in the arm, the third driven through a parallelogram."""

from __future__ import annotations

from math import pi

from mbs.mechanism import Mechanism
from mbs.robots.rows import cuboid, frame, robot

_SOURCE = (
    "Structure: Khalil & Kleinfinger 1986 and Khalil & Dombre 2002, chapter 7; lengths, masses and"
    " inertias are illustrative"
)
_D2, _D3, _D4, _RL4, _D8 = 0.4, 0.8, -0.2, 1.0, 0.3


def sr400() -> Mechanism:
    """SR400: eight links, nine revolute joints, one parallelogram of links 2, 3, 7, 8.

    The joints q1, q2, q4, q5, q6 and q7 are actuated, and the loop is cut at q9. It is closed if q3
    = pi/2 - q2 + q7, q8 = q2 - q7 and q9 = pi - q8. It is singular at q2 = q7, for example at the
    zero configuration. The mechanism is assembled at q2 = -pi/2, with the arm upright.

    Source: frames of Khalil & Dombre 2002, section 7 (after Khalil & Kleinfinger 1986), d2 = d7, d9
    = d3, d10 = -d8, gamma10 = pi/2. Lengths, masses and inertias are illustrative.
    """
    half = pi / 2
    frames = [
        frame(0, actuated=True),
        frame(1, alpha=-half, d=_D2, actuated=True),
        frame(2, d=_D3, actuated=False),
        frame(3, alpha=-half, d=_D4, r=_RL4, actuated=True),
        frame(4, alpha=half, actuated=True),
        frame(5, alpha=-half, actuated=True),
        frame(1, alpha=-half, d=_D2, actuated=True),
        frame(7, d=_D8, actuated=False),
        frame(8, d=_D3, actuated=False),
        frame(3, "fixed", gamma=half, d=-_D8),
    ]
    bodies = [
        cuboid(1, 100, (0.6, 0.5, 0.5), (0.1, 0, -0.1), Ia=10),
        cuboid(2, 60, (0.9, 0.2, 0.15), (0.4, 0, 0.1), Ia=10),
        cuboid(3, 50, (0.4, 0.4, 0.3), (-0.1, 0.1, 0)),
        cuboid(4, 20, (0.15, 0.15, 0.6), (0, 0, -0.3), Ia=1),
        cuboid(5, 8, (0.15, 0.15, 0.15), (0, 0.01, 0), Ia=0.5),
        cuboid(6, 3, (0.1, 0.1, 0.1), (0, 0, 0.08), Ia=0.2),
        cuboid(7, 15, (0.4, 0.15, 0.1), (0.15, 0, 0), Ia=10),
        cuboid(8, 10, (0.85, 0.06, 0.06), (0.4, 0, 0)),
    ]
    return robot(
        "sr400",
        _SOURCE,
        frames,
        bodies,
        loop=[{"cut": [9, 10], "joint": "revolute"}],
        guess={"q2": -half, "q3": pi, "q8": -half},
    )
