"""Bricard's over-constrained mechanism, problem A04 of the multibody benchmark library."""

from __future__ import annotations

from math import pi

from mbs.components import Box, Revolute
from mbs.mechanism import Mechanism

_SOURCE = (
    "Gonzalez, Dopico, Lugris & Cuadrado 2006, multibody benchmark library, problem A04; Bricard"
    " 1897"
)
_TURNS = (("x", 0.0), ("z", -pi / 2), ("y", -pi / 2), ("z", pi), ("z", pi / 2))
"""From x to the direction of each rod."""
_AXES = "yzxyzx"


def bricard() -> Mechanism:
    """Bricard's mechanism: one loop of six revolute joints, with one degree of freedom.

    Gruebler's formula gives zero degrees of freedom. Five rods of 1 m length, 1 kg mass and 0.1 m x
    0.1 m section lie along edges of a unit cube, in the directions x, -y, z, -x and y; the ground
    is the sixth edge. The axes of the joints j1 .. j6 are y, z, x, y, z and x in the assembled
    configuration, where all joint positions are zero. Joint j6 on the ground at (0, 0, 1) closes
    the loop. Gravity is along -y, and the benchmark starts at rest. The frame P3 is at the end of
    the third rod.

    Source: Gonzalez et al. 2006, problem A04; Bricard 1897.
    """
    m = Mechanism("bricard", gravity=(0, -9.81, 0), source=_SOURCE)
    rods = [m.add(Box(f"rod{k + 1}", length=1, width=0.1, mass=1)) for k in range(len(_TURNS))]
    before = m.world.at()
    for k, (rod, (axis, angle)) in enumerate(zip(rods, _TURNS, strict=True)):
        upright = (axis, -angle)
        m.connect(before, _hinge(k), rod.at(rotation=upright))
        before = rod.at(1, rotation=upright)
    closing = _hinge(5)
    m.connect(before, closing, m.world.at(0, 0, 1))
    m.cut(closing)
    m.add_frame("P3", rods[2].right)
    return m


def _hinge(k: int) -> Revolute:
    """Return the passive revolute joint with index k (from 0), about its axis at zero."""
    return Revolute(f"j{k + 1}", axis=_AXES[k], actuated=False)
