"""A spatial four-bar mechanism with a rod without mass, Fourbar2 of the Modelica library."""

from __future__ import annotations

import math

from mbs.components import Prismatic, Revolute, Rod
from mbs.mechanism import Mechanism
from mbs.robots._modelica_four_bar import CRANK, DIAMETER, GRAVITY, ROCKER, ROD, STEEL
from mbs.robots.bars import round_bar

_SOURCE = (
    "Modelica Standard Library, Modelica.Mechanics.MultiBody.Examples.Loops.Fourbar2; Otter,"
    " Elmqvist & Mattsson 2003"
)


def modelica_rod_four_bar() -> Mechanism:
    """Spatial four-bar mechanism whose crank and slider are connected by a massless rod.

    Joint j1 rotates the crank b1 about x at the origin. Joint j2 moves the lower end of the bar b2
    along x, from x = 1.2 m. Both bars are those of `modelica_four_bar`. The example starts with 300
    degrees/s, `v0={"j1": 5.235987755982989}`.

    Source: Modelica Standard Library, example Fourbar2.
    """
    m = Mechanism(
        "modelica_rod_four_bar", gravity=(0, -GRAVITY, 0), source=_SOURCE, guess={"j2": -0.2}
    )
    b1 = m.add(round_bar("b1", CRANK, DIAMETER, STEEL))
    b2 = m.add(round_bar("b2", ROCKER, DIAMETER, STEEL))
    m.connect(m.world, Revolute("j1", axis="x", actuated=False), b1)
    m.connect(m.world.at(1.2), Prismatic("j2", axis="x"), b2)
    m.connect(b2.at(*ROCKER), Rod("rod", length=math.hypot(*ROD)), b1.at(*CRANK))
    return m
