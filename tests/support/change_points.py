"""Four-bar linkages whose bars can lie on one line, and a slider-crank with a driven slide."""

import mbs
from mbs.components import Body, Prismatic, Revolute

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


def slider_crank():
    m = mbs.Mechanism("piston", gravity=GRAVITY)
    crank, bar, head = m.add(rod("crank", 0.3)), m.add(rod("bar", 0.8)), m.add(Body("h", mass=1))
    m.connect(m.world, Revolute("j1"), crank)
    m.connect(crank.at(0.3), Revolute("j2"), bar)
    m.connect(m.world, Prismatic("slide", axis="x", actuated=True), head)
    m.connect(bar.at(0.8), pin := Revolute("pin"), head)
    m.cut(pin)
    return m.assemble(active=["slide"], guess={"j1": 1.0, "j2": -1.3, "slide": 0.9})
