"""A stiff flyball governor, problem A05 of the multibody benchmark library."""

from __future__ import annotations

from math import pi

from mbs.components import (
    Box,
    PointMass,
    Prismatic,
    Revolute,
    Spring,
)
from mbs.mechanism import Mechanism

_SOURCE = "Gonzalez, Dopico, Lugris & Cuadrado 2006, multibody benchmark library, problem A05"
_DENSITY = 3000
_ARM = 0.05
_UPRIGHT = ("y", pi / 2)
"""From the x of a bar, which points up, to a frame with z up."""


def flyball_governor() -> Mechanism:
    """Watt's flyball governor with stiff spring-dampers in place of the lower rods.

    A shaft of 1 m length rotates about z by `spin`. A slider, a cube of 0.1 m, moves along the
    shaft at the height `s` above its lower end. Two rods of 1 m length are attached to the top of
    the shaft, 0.05 m off the axis, each with 5 kg at its end; alpha1 and alpha2 are their angles
    below the horizontal. Springs of 8e5 N/m with dampers of 4e4 N s/m and a free length of 0.5 m
    connect the middle of each rod to the slider. Shaft and rods have 0.01 m x 0.01 m sections; they
    and the slider have a density of 3000 kg/m^3. Gravity is along -z. The mechanism is assembled
    with s = 0.5 m and both angles 30 degrees; the benchmark starts with `v0={"spin": 2 * pi}`
    [rad/s].

    Source: Gonzalez et al. 2006, problem A05.
    """
    guess = {"s": 0.5, "alpha1": pi / 6, "alpha2": pi / 6}
    m = Mechanism("flyball_governor", gravity=(0, 0, -9.81), source=_SOURCE, guess=guess)
    shaft = m.add(Box("shaft", length=1, width=0.01, density=_DENSITY))
    slider = m.add(Box("slider", length=0.1, width=0.1, density=_DENSITY))
    m.connect(m.world, Revolute("spin", axis="z", actuated=False), shaft.at(rotation=_UPRIGHT))
    along = Prismatic("s", axis="z", actuated=False)
    m.connect(shaft.at(rotation=_UPRIGHT), along, slider.at(_ARM))
    for number, side in ((1, 0.0), (2, pi)):
        top = shaft.at(1, rotation=[_UPRIGHT, ("z", side)])
        rod = m.add(Box(f"rod{number}", length=1, width=0.01, density=_DENSITY))
        ball = m.add(PointMass(f"ball{number}", mass=5))
        hinge = Revolute(f"alpha{number}", axis="y", actuated=False)
        m.connect(top.at(_ARM), hinge, rod.left)
        m.connect(rod.right, ball)
        lower = slider.at(_ARM, rotation=("z", side)).at(_ARM)
        m.add(Spring(f"spring{number}", lower, rod.center, stiffness=8e5, length=0.5, damping=4e4))
    return m
