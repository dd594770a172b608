"""A spatial four-bar mechanism, example Fourbar1 of the Modelica Standard Library."""

from __future__ import annotations

from mbs.components import Body, Prismatic, Revolute
from mbs.mechanism import Mechanism
from mbs.robots.bars import round_bar

_SOURCE = (
    "Modelica Standard Library, Modelica.Mechanics.MultiBody.Examples.Loops.Fourbar1; Otter,"
    " Elmqvist & Mattsson 2003"
)
GRAVITY = 9.80665
DIAMETER, STEEL = 0.05, 7700
CRANK, ROCKER, ROD = (0, 0.5, 0.1), (0, 0.2, 0), (-1, 0.3, 0.1)


def modelica_four_bar() -> Mechanism:
    """Spatial four-bar mechanism with six revolute joints and one prismatic joint.

    Joint j1 rotates the crank b1 about x at the origin. Joint j2 moves the lower end of the bar b2
    along x, from x = 1.2 m. The joints rev and rev1 about y and z connect b2 with the massive
    connecting rod b3. The joints j3, j4 and j5 about x, y and z close the loop at the end of the
    crank. All bars are steel cylinders of 0.05 m diameter; gravity is 9.80665 m/s^2 along -y. The
    mechanism is assembled with j1 = 0, j2 = -0.2 m and all other angles zero; the example starts
    with 300 degrees/s, `v0={"j1": 5.235987755982989}`.

    Source: Modelica Standard Library, example Fourbar1; its loops: Otter et al. 2003.
    """
    gravity = (0, -GRAVITY, 0)
    m = Mechanism("modelica_four_bar", gravity=gravity, source=_SOURCE, guess={"j2": -0.2})
    b1 = m.add(round_bar("b1", CRANK, DIAMETER, STEEL))
    b2 = m.add(round_bar("b2", ROCKER, DIAMETER, STEEL))
    b3 = m.add(round_bar("b3", ROD, DIAMETER, STEEL))
    j1, rev, rev1, j3, j4, j5 = (
        Revolute(name, axis=axis, actuated=False)
        for name, axis in zip(("j1", "rev", "rev1", "j3", "j4", "j5"), "xyzxyz", strict=True)
    )
    m.connect(m.world, j1, b1)
    m.connect(m.world.at(1.2), Prismatic("j2", axis="x"), b2)
    hub, cross, spider = (m.add(Body(name, mass=0)) for name in ("hub", "cross", "spider"))
    m.connect(b2.at(*ROCKER), rev, hub)
    m.connect(hub, rev1, b3)
    m.connect(b1.at(*CRANK), j3, cross)
    m.connect(cross, j4, spider)
    m.connect(spider, j5, b3.at(*ROD))
    m.cut(j5)
    return m
