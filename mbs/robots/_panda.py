"""Franka Emika Panda: seven revolute joints."""

from __future__ import annotations

from math import pi
from typing import Any

from mbs.mechanism import Mechanism
from mbs.robots.rows import cuboid, frame, robot

_SOURCE = (
    "Geometry and limits: Franka Emika, Denavit-Hartenberg parameters in Craig's convention and"
    " joint ranges, velocities and torques of the Panda; masses and inertias are illustrative:"
    " homogeneous cuboids"
)
_LARGE: dict[str, Any] = {"velocity": 2.175, "effort": 87}
_SMALL: dict[str, Any] = {"velocity": 2.61, "effort": 12}
_GUESS = {"q4": -pi / 2, "q6": pi / 2}


def panda() -> Mechanism:
    """Franka Emika Panda: seven revolute joints q1 .. q7, with one redundant joint.

    Frame 7 is on the flange, 107 mm beyond the last joint. The assembled configuration lies within
    the joint ranges, while the zero configuration does not.

    Source: modified Denavit-Hartenberg parameters and limits of joints published by Franka Emika.
    Masses, inertias and rotors are illustrative.
    """
    half = pi / 2
    frames = [
        frame(0, r=0.333, limits=[-2.8973, 2.8973], **_LARGE),
        frame(1, alpha=-half, limits=[-1.7628, 1.7628], **_LARGE),
        frame(2, alpha=half, r=0.316, limits=[-2.8973, 2.8973], **_LARGE),
        frame(3, alpha=half, d=0.0825, limits=[-3.0718, -0.0698], **_LARGE),
        frame(4, alpha=-half, d=-0.0825, r=0.384, limits=[-2.8973, 2.8973], **_SMALL),
        frame(5, alpha=half, limits=[-0.0175, 3.7525], **_SMALL),
        frame(6, alpha=half, d=0.088, r=0.107, limits=[-2.8973, 2.8973], **_SMALL),
    ]
    bodies = [
        cuboid(1, 3, (0.12, 0.12, 0.2), (0, -0.02, -0.05), Ia=0.6),
        cuboid(2, 3, (0.12, 0.2, 0.12), (0, -0.05, 0.02), Ia=0.6),
        cuboid(3, 2.5, (0.12, 0.12, 0.15), (0.03, 0.02, -0.05), Ia=0.5),
        cuboid(4, 2.5, (0.12, 0.15, 0.12), (-0.04, 0.04, 0.02), Ia=0.5),
        cuboid(5, 2.5, (0.1, 0.1, 0.25), (0, 0.03, -0.1), Ia=0.2),
        cuboid(6, 1.5, (0.12, 0.1, 0.1), (0.05, 0, 0), Ia=0.2),
        cuboid(7, 0.7, (0.08, 0.08, 0.06), (0, 0, -0.04), Ia=0.1),
    ]
    return robot("panda", _SOURCE, frames, bodies, guess=_GUESS)
