"""A planar four-bar mechanism, composed of boxes."""

from __future__ import annotations

from mbs.components import Box, Revolute
from mbs.mechanism import Mechanism


def four_bar() -> Mechanism:
    """Planar four-bar linkage: crank a, coupler b and rocker c of 0.4, 1.0 and 0.9 m.

    The ground link has a length of 0.8 m. The joint j1 of the crank is driven; gravity is along -y.
    The mechanism is assembled upright, near j2 = 1 rad. The boxes are of aluminium, 0.05 m wide and
    high. All values are illustrative.
    """
    m = Mechanism(
        "four_bar",
        gravity=(0, -9.81, 0),
        source="Textbook mechanism; lengths, density and section are illustrative",
        guess={"j1": 0.0, "j2": 1.0},
    )
    a, b, c = (
        m.add(Box(name, length=length, width=0.05, density=2700))
        for name, length in (("a", 0.4), ("b", 1.0), ("c", 0.9))
    )
    m.connect(m.world, Revolute("j1", axis="z", actuated=True), a.left)
    m.connect(a.right, Revolute("j2", axis="z"), b.left)
    m.connect(b.right, Revolute("j3", axis="z"), c.right)
    m.connect(m.world.at(0.8, 0, 0), Revolute("j4", axis="z"), c.left)
    return m
