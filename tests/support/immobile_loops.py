"""An arm on a triangle of bars, which cannot move, and the same on one body in its place."""

from math import acos, pi

import mbs
from mbs.components import AbsoluteSensor, Body, JointSensor, Revolute

A, B, C = 0.4, 0.5, 0.3
"""Sides of the triangle [m]: bars a and b and the distance of their feet."""

AT_FOOT = acos((A**2 + C**2 - B**2) / (2 * A * C))
"""Angle between bar a and the base of the triangle [rad]."""

AT_TOP = pi - acos((A**2 + B**2 - C**2) / (2 * A * B))
"""Angle by which bar b turns back from bar a [rad]."""


def triangle(*, moves, rigid):
    """An arm on the tip of a triangle.

    Args:
        moves: whether the triangle stands on a link that turns, and not on the ground.
        rigid: whether its bars are welded together, and not joined.
    """
    m = mbs.Mechanism("rigid" if rigid else "bars", gravity=(1.5, -9.81, 0.4))
    foot = m.world
    if moves:
        mast = Body("mast", mass=2, com=(0.1, 0.2, -0.1), inertia=(0.2, 0.1, 0.15))
        foot = m.add(mast)
        m.connect(m.world, Revolute("q1", axis="x", Fv=0.3, Ia=0.05), foot)
    bar = dict(mass=1.2, inertia=(0.01, 0.05, 0.06))
    a, b = (
        m.add(Body("a", com=(A / 2, 0.01, 0.02), **bar)),
        m.add(Body("b", com=(B / 2, 0, 0), **bar)),
    )
    arm = m.add(Body("arm", mass=0.8, com=(0.2, 0.02, 0.01), inertia=(0.01, 0.03, 0.04)))
    if rigid:
        m.connect(foot.at(0, 0, 0, rotation=("z", AT_FOOT)), a)
        m.connect(a.at(A, 0, 0, rotation=("z", -AT_TOP)), b)
    else:
        m.connect(foot, Revolute("c1", axis="z", actuated=False), a)
        m.connect(a.at(A, 0, 0), Revolute("c2", axis="z", actuated=False), b)
        m.connect(b.at(B, 0, 0), Revolute("c3", axis="z", actuated=False), foot.at(C, 0, 0))
        m.add(JointSensor("foot", "c3"))
    m.connect(a.at(A, 0, 0), Revolute("q2", axis=(0, 0.6, 0.8), Fv=0.1, Ia=0.01, Fs=0.2), arm)
    m.add(AbsoluteSensor("tip", arm.at(0.3, 0, 0)))
    return m.assemble(guess={} if rigid else {"c1": AT_FOOT, "c2": -AT_TOP})
