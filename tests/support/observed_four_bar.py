"""A four-bar full of sensors."""

from __future__ import annotations

import mbs
from mbs.components import (
    AbsoluteSensor,
    Box,
    DistanceSensor,
    JointSensor,
    PowerSensor,
    RelativeSensor,
    Revolute,
    WrenchSensor,
)


def four_bar(driven="j1"):
    m = mbs.Mechanism("four_bar", gravity=(0, -9.81, 0))
    a, b, c = (m.add(Box(n, length=x, mass=1 + x)) for n, x in (("a", 0.4), ("b", 1.0), ("c", 0.9)))
    m.connect(m.world, Revolute("j1", actuated=driven == "j1"), a.left)
    m.connect(a.right, Revolute("j2"), b.left)
    m.connect(b.right, Revolute("j3"), c.right)
    m.connect(m.world.at(0.8), Revolute("j4", actuated=driven == "j4"), c.left)
    m.add(AbsoluteSensor("tip", b.at(0.5, 0.3, 0.1)))
    m.add_frame("probe", b.at(0.5, 0.3, 0.1))
    m.add(RelativeSensor("seen", c, b.at(0.2, 0.1, 0)))
    m.add(DistanceSensor("reach", m.world, c.right))
    m.add(WrenchSensor("pin", "j3"))
    for name in ("j1", "j2", "j3", "j4"):
        m.add(JointSensor(f"e{name[1]}", name))
        m.add(PowerSensor(f"p{name[1]}", name))
    return m.assemble(guess={"j1": 0.4, "j2": 0.7, "j4": 1.3})
