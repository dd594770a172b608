"""AKR3000: a painting robot whose arm and forearm are moved by two linear motors."""

from __future__ import annotations

from math import pi

from mbs.mechanism import Mechanism
from mbs.robots.rows import cuboid, frame, robot

_SOURCE = (
    "Frames and lengths: example AKR3000 of OpenSYMORO, Khalil et al. 2014; masses and inertias are"
    " illustrative"
)
_GUESS = {"q2": pi / 2, "q3": -0.07, "q4": 0.1, "q5": -0.08, "q6": -0.06}
_D3, _D4, _R5, _R6, _D7, _R8, _D13, _D14 = -0.2, 0.2, 0.3, 0.3, 0.3, 0.5, 0.2, 0.3


def akr3000() -> Mechanism:
    """Painting robot AKR3000: ten links, and two loops with one linear motor each.

    The trunk q1, the linear motors q5 and q6, and the wrist joints q8, q9 and q10 are actuated.
    Motor q6 acts between the trunk (joint q4) and the arm, and lifts the arm q2. Motor q5 acts
    between the trunk (joint q3) and the forearm, and lifts the forearm q7. The loops are cut at q11
    and q12. The mechanism is assembled with an upright arm and a level forearm.

    Source: frames of the example AKR3000 of OpenSYMORO, Khalil et al. 2014, with its lengths in m.
    Masses and inertias are illustrative.
    """
    half = pi / 2
    frames = [
        frame(0, actuated=True),
        frame(1, alpha=half, actuated=False),
        frame(1, alpha=half, d=_D3, actuated=False),
        frame(1, alpha=half, d=_D4, actuated=False),
        frame(3, "prismatic", alpha=-half, r=_R5, actuated=True),
        frame(4, "prismatic", alpha=-half, r=_R6, actuated=True),
        frame(2, d=_D7, actuated=False),
        frame(7, alpha=-half, r=_R8, actuated=True),
        frame(8, alpha=half, actuated=True),
        frame(9, alpha=-half, actuated=True),
        frame(5, alpha=half, actuated=False),
        frame(6, alpha=half, actuated=False),
        frame(7, "fixed", gamma=pi / 1.6, d=_D13),
        frame(2, "fixed", gamma=-pi / 5, d=_D14),
    ]
    bodies = [
        cuboid(1, 80, (0.5, 0.4, 0.3), (0, 0, -0.1), Ia=5),
        cuboid(2, 25, (0.4, 0.12, 0.12), (0.15, 0, 0)),
        cuboid(3, 4, (0.06, 0.2, 0.06), (0, 0.1, 0)),
        cuboid(4, 4, (0.06, 0.2, 0.06), (0, 0.1, 0)),
        cuboid(5, 1.5, (0.03, 0.03, 0.2), (0, 0, -0.1), Ia=20),
        cuboid(6, 1.5, (0.03, 0.03, 0.2), (0, 0, -0.1), Ia=20),
        cuboid(7, 15, (0.1, 0.5, 0.1), (0, 0.2, 0)),
        cuboid(8, 3, (0.08, 0.08, 0.12), (0, 0, -0.08), Ia=0.2),
        cuboid(9, 1.5, (0.06, 0.06, 0.06), (0, 0, 0), Ia=0.1),
        cuboid(10, 1, (0.05, 0.05, 0.1), (0, 0, 0.06), Ia=0.05),
    ]
    loops = [{"cut": cut, "joint": "revolute"} for cut in ([11, 13], [12, 14])]
    return robot("akr3000", _SOURCE, frames, bodies, loop=loops, guess=_GUESS)
