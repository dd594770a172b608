"""The Stanford arm: a prismatic third joint and a spherical wrist."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np

from mbs.mechanism import Mechanism
from mbs.robots.rows import Row, about_origin, frame, robot

_SOURCE = (
    "Geometry: Scheinman 1969, Stanford AIM-92, and Paul 1972, AIM-177; inertial data: Paul 1981,"
    " Robot Manipulators, tables 6.4 to 6.6"
)


def stanford() -> Mechanism:
    """Stanford arm: joints q1, q2 revolute, q3 prismatic, q4 .. q6 revolute.

    Source: lengths 0.412 and 0.154 m from Paul 1972 (AIM-177, figure 2.3); masses, centres of mass,
    inertias and rotor inertias from Paul 1981, tables 6.4 to 6.6. Paul's inertias are interpreted
    as moments about the origins of his standard Denavit-Hartenberg frames, which lie on the next
    joint, and his centres of mass as centimetres; only then is every inertia physically possible.
    Both are rotated here into the modified frames, which have the same origins. The tool plate is
    0.263 m from the wrist. The constant rotation of -pi/2 in joint 3 of Paul is part of q4 here.
    """
    half = pi / 2
    frames = [
        frame(0, r=0.412),
        frame(1, alpha=-half, r=0.154),
        frame(2, "prismatic", alpha=half, limits=[0.3048, 1.27]),
        frame(3),
        frame(4, alpha=-half),
        frame(5, alpha=half),
    ]
    bodies = [
        _link(1, -half, 9.29, (0, 0.0175, -0.1105), (0.276, 0.255, 0.071), 0.953),
        _link(2, half, 5.01, (0, -0.1054, 0), (0.108, 0.018, 0.100), 2.193),
        _link(3, 0, 4.25, (0, 0, -0.6447), (2.51, 2.51, 0.006), 0.782),
        _link(4, -half, 1.08, (0, 0.0092, -0.0054), (0.002, 0.001, 0.001), 0.106),
        _link(5, half, 0.63, (0, 0, 0.0566), (0.003, 0.003, 0.0004), 0.097),
        _link(6, 0, 0.51, (0, 0, 0.1554), (0.013, 0.013, 0.0003), 0.020),
    ]
    return robot("stanford", _SOURCE, frames, bodies)


def _link(
    number: int,
    twist: float,
    mass: float,
    com: tuple[float, float, float],
    moments: tuple[float, float, float],
    Ia: float,
) -> Row:
    """Return the row of a link from its data in a standard Denavit-Hartenberg frame.

    The modified frame has the same origin, and the standard frame is rotated by `twist` [rad] about
    its x axis. Units: kg, m, kg m^2; `Ia` is the rotor inertia of the joint.
    """
    c, s = round(cos(twist)), round(sin(twist))
    R = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    turned = R @ np.array(com)
    return about_origin(number, mass, list(turned), R @ np.diag(moments) @ R.T, Ia=Ia)
