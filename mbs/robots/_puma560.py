"""Unimation PUMA 560, the arm on which models are compared since 1986."""

from __future__ import annotations

from math import pi

from mbs.mechanism import Mechanism
from mbs.robots.rows import body, degrees, frame, robot

_SOURCE = (
    "Armstrong, Khatib & Burdick 1986, The explicit dynamic model and inertial parameters of the"
    " PUMA 560 arm: modified Denavit-Hartenberg geometry, masses, centres of mass, inertias and"
    " rotor inertias"
)


def puma560() -> Mechanism:
    """Unimation PUMA 560: six revolute joints q1 .. q6, without friction.

    Source: Armstrong, Khatib & Burdick 1986, tables of link geometry, masses, centres of mass,
    diagonal inertias and motor inertias; link 3 without the wrist. The inertia of link 3 is
    expressed in the axes of the link frame: it is small about y, along which the forearm lies. The
    largest published moment of link 3, 0.086 kg m^2, is larger than physically possible with the
    other two moments. It is replaced by the largest possible value, 0.0785 kg m^2, which is within
    the published uncertainty. For link 1 only the moment about the joint axis was measured; its
    other parameters have no effect. Joint ranges: Fu, Gonzalez & Lee 1987.
    """
    half = pi / 2
    frames = [
        frame(0, limits=degrees(-160, 160)),
        frame(1, alpha=-half, r=0.2435, limits=degrees(-225, 45)),
        frame(2, d=0.4318, r=-0.0934, limits=degrees(-45, 225)),
        frame(3, alpha=half, d=-0.0203, r=0.4331, limits=degrees(-110, 170)),
        frame(4, alpha=-half, limits=degrees(-100, 100)),
        frame(5, alpha=half, limits=degrees(-266, 266)),
    ]
    bodies = [
        {"frame": 1, "ZZ": 0.35, "Ia": 1.14},
        body(2, 17.4, (0.068, 0.006, -0.016), (0.130, 0.524, 0.539), Ia=4.71),
        body(3, 4.8, (0, -0.070, 0.014), (0.066, 0.0125, 0.0785), Ia=0.827),
        body(4, 0.82, (0, 0, -0.019), (1.8e-3, 1.8e-3, 1.3e-3), Ia=0.200),
        body(5, 0.34, (0, 0, 0), (0.3e-3, 0.3e-3, 0.4e-3), Ia=0.179),
        body(6, 0.09, (0, 0, 0.032), (0.15e-3, 0.15e-3, 0.04e-3), Ia=0.193),
    ]
    return robot("puma560", _SOURCE, frames, bodies)
