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
    """Bricard's mechanism: six revolute joints in one loop, of mobility 1 where Gruebler counts 0.

    Five rods of 1 m, 1 kg and 0.1 m x 0.1 m section run along the edges of a unit cube, along x,
    -y, z, -x and y; the ground is the sixth edge. Joints j1 .. j6 about y, z, x, y, z, x of the
    assembled configuration, where all are zero; j6, back on the ground at (0, 0, 1), closes the
    loop. Gravity is along -y; it starts at rest. Its output is P3, the end of the third rod.

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
    return Revolute(f"j{k + 1}", axis=_AXES[k], actuated=False)
