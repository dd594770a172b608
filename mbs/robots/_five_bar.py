"""A planar five-bar mechanism with two motors on the ground."""

from __future__ import annotations

from mbs.mechanism import Mechanism
from mbs.robots.rows import cuboid, frame, robot

_SOURCE = "Textbook mechanism; lengths, masses and inertias are illustrative"
_GUESS = {"q1": 2.1, "q2": -1.2, "q3": 1.0, "q4": 1.2}
_GROUND, _CRANK, _COUPLER = 0.2, 0.25, 0.35


def five_bar() -> Mechanism:
    """Planar five-bar linkage in a vertical plane, with motors q1 and q3 on the ground.

    Cranks of 0.25 m turn about points 0.2 m apart, couplers of 0.35 m meet in the cut joint. It is
    assembled symmetric, the cut joint above the ground. The frame `tool` is in the cut joint, on
    the coupler of the first crank. All values are illustrative.
    """
    frames = [
        frame(0, actuated=True),
        frame(1, d=_CRANK, actuated=False),
        frame(0, d=_GROUND, actuated=True),
        frame(3, d=_CRANK, actuated=False),
        frame(4, d=_COUPLER, actuated=False),
        frame(2, "fixed", d=_COUPLER),
    ]
    bodies = [
        cuboid(number, mass, (length, 0.03, 0.02), (length / 2, 0, 0))
        for number, mass, length in (
            (1, 0.5, _CRANK),
            (2, 0.6, _COUPLER),
            (3, 0.5, _CRANK),
            (4, 0.6, _COUPLER),
        )
    ]
    loops = [{"cut": [5, 6], "joint": "revolute"}]
    m = robot("five_bar", _SOURCE, frames, bodies, loop=loops, gravity=[0, -9.81, 0], guess=_GUESS)
    coupler = next(body for body in m.bodies() if body.name == "link2")
    m.add_frame("tool", coupler.at(_COUPLER))
    return m
