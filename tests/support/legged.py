"""Mechanisms that stand on feet."""

from __future__ import annotations

from mbs import Mechanism
from mbs.components import (
    Body,
    Free,
    Prismatic,
    Revolute,
    Spherical,
    Universal,
)

FEET = {"fl": (0.3, 0.15), "fr": (0.3, -0.15), "hl": (-0.3, 0.15), "hr": (-0.3, -0.15)}
"""Where the hips of the quadruped are."""


def quadruped():
    """A trunk on four legs of three joints, above a slope."""
    m = Mechanism("quadruped", gravity=(0, 0, -9.81))
    trunk = m.add(Body("trunk", mass=10, inertia=(0.1, 0.3, 0.4)))
    m.connect(m.world, Free("base"), trunk)
    m.add_frame("slope", m.world.at(0, 0, -0.4, rotation=("y", 0.2)))
    for name, (x, y) in FEET.items():
        upper, lower = (
            m.add(Body(f"{name}_{part}", mass=w, com=(0, 0, -0.1), inertia=(0.01, 0.01, 0.002)))
            for part, w in (("upper", 1.0), ("lower", 0.5))
        )
        hip = Universal(f"{name}_hip", axes=("x", "y"), actuated=True)
        m.connect(trunk.at(x, y, 0), hip, upper)
        m.connect(upper.at(0, 0, -0.25), Revolute(f"{name}_knee", axis="y", actuated=True), lower)
        m.add_frame(name, lower.at(0, 0, -0.25))
    return m.assemble()


def hopping_leg(pinned=False):
    """A trunk in space on a leg that a hip and a slide move.

    Args:
        pinned: whether a ball joint holds the foot at the origin, instead of nothing.
    """
    m = Mechanism("hopper", gravity=(0, 0, -9.81))
    trunk = m.add(Body("trunk", mass=3, com=(0.02, 0.01, 0.05), inertia=(0.1, 0.12, 0.08)))
    thigh = m.add(Body("thigh", mass=0.6, com=(0, 0.01, -0.1), inertia=(0.01, 0.012, 0.002)))
    shin = m.add(Body("shin", mass=0.4, com=(0, 0.005, -0.15), inertia=(0.004, 0.004, 0.001)))
    m.connect(m.world, Free("base"), trunk)
    m.connect(trunk, Revolute("hip", axis="y", actuated=True), thigh)
    m.connect(thigh.at(0, 0, -0.1), Prismatic("slide", axis="-z", actuated=True), shin)
    m.add_frame("foot", shin.at(0, 0, -0.3))
    if pinned:
        m.connect(m.world, Spherical("ground"), shin.at(0, 0, -0.3))
    return m.assemble({"base.z": 0.45, "base.x": 0.1, "hip": 0.2, "slide": 0.05})
