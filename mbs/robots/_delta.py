"""A Delta robot: three arms, and a platform that six rods keep parallel to the base."""

from __future__ import annotations

from math import pi, sqrt

from mbs.components import (
    Body,
    Cylinder,
    Free,
    PointMass,
    Revolute,
    Rod,
)
from mbs.mechanism import Mechanism

_SOURCE = (
    "Structure: Clavel 1988; forearms as point masses, two thirds at the elbow: Codourey 1998;"
    " lengths and masses are illustrative"
)
_BASE, _ARM, _FOREARM, _PLATFORM = 0.20, 0.25, 0.60, 0.05
_HALF = 0.04
_FOREARM_MASS, _PLATFORM_MASS = 0.12, 0.8


def delta() -> Mechanism:
    """Delta robot: motors q1, q2 and q3 move a platform that only translates.

    Three arms of 0.25 m length are mounted on a circle of 0.2 m radius, at 0, 120 and 240 degrees;
    a positive angle lowers an arm. A pair of rods of 0.6 m length, 0.08 m apart, connects each
    elbow with a circle of 0.05 m radius on the platform, below the base. The rods are massless: two
    thirds of the 0.12 kg of each pair are at the elbow, one third is on the platform. The mechanism
    is assembled with horizontal arms. The frame `tool` is in the middle of the platform.

    Source: structure of Clavel 1988; masses of the forearms as in Codourey 1998. Lengths and masses
    are illustrative.
    """
    height = sqrt(_FOREARM**2 - (_BASE + _ARM - _PLATFORM) ** 2)
    m = Mechanism("delta", source=_SOURCE, guess={"platform.z": -height})
    plate = m.add(Body("plate", mass=_PLATFORM_MASS, inertia=(4e-4, 4e-4, 8e-4)))
    m.connect(m.world, Free("platform"), plate)
    ends = m.add(PointMass("forearm_ends", mass=_FOREARM_MASS))
    m.connect(plate, ends)
    m.add_frame("tool", plate)
    for k in range(3):
        around = ("z", 2 * pi * k / 3)
        arm = m.add(Cylinder(f"arm{k + 1}", length=_ARM, radius=0.015, mass=0.3))
        elbow = m.add(PointMass(f"elbow{k + 1}", mass=2 / 3 * _FOREARM_MASS))
        hinge = m.world.at(rotation=around).at(_BASE)
        m.connect(hinge, Revolute(f"q{k + 1}", axis="y", actuated=True, Ia=0.01), arm)
        m.connect(arm.right, elbow)
        side = plate.at(rotation=around).at(_PLATFORM)
        for letter, y in (("a", -_HALF), ("b", _HALF)):
            forearm = Rod(f"rod{k + 1}{letter}", length=_FOREARM)
            m.connect(arm.at(_ARM, y), forearm, side.at(0, y))
    return m
