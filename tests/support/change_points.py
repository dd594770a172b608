"""Four-bar linkages, also those whose bars can lie on one line."""

import mbs
from mbs.components import Body, Revolute

GRAVITY = (0, -9.81, 0)


def rod(name, length):
    inertia = length**3 / 12
    return Body(name, mass=length, com=(length / 2, 0, 0), inertia=(0, inertia, inertia))


def linkage(lengths, guess, more=()):
    """Crank, coupler, rocker and ground of a four-bar linkage in the vertical plane."""
    crank, coupler, rocker, ground = lengths
    m = mbs.Mechanism("linkage", gravity=GRAVITY)
    a, b, c = (m.add(rod(n, x)) for n, x in zip("abc", (crank, coupler, rocker), strict=True))
    m.connect(m.world, Revolute("j1", actuated=True), a)
    m.connect(a.at(crank), Revolute("j2"), b)
    m.connect(m.world.at(ground), Revolute("j4"), c)
    m.connect(b.at(coupler), closing := Revolute("j3"), c.at(rocker))
    m.cut(closing)
    for element in more:
        m.add(element)
    return m.assemble(guess=dict(zip(("j1", "j2", "j4"), guess, strict=True)))
