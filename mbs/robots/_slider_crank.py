"""A planar slider-crank, the rigid form of a benchmark for flexible mechanisms."""

from __future__ import annotations

from mbs.components import Body, Prismatic, Revolute
from mbs.mechanism import Mechanism

_SOURCE = (
    "Simeon 1996, Modelling a flexible slider crank mechanism; Mazzia & Magherini 2008, Test Set"
    " for IVP Solvers, slider crank; here with a rigid connecting rod"
)
_CRANK, _ROD = 0.15, 0.30


def slider_crank() -> Mechanism:
    """Planar slider-crank: crank of 0.15 m, rod of 0.3 m, slider along x, no gravity.

    The joint `crank` is driven, and the joint `slide` is the distance of the slider from the axis
    of the crank. The mechanism is assembled stretched, with crank and rod along x. The published
    moments of inertia are about the joints, j1 of the crank and j2 of the rod.

    Source: Simeon 1996; Mazzia & Magherini 2008, with a flexible rod. Here the rod is rigid.
    """
    guess = {"crank": 0.0, "rod": 0.0, "slide": _CRANK + _ROD}
    m = Mechanism("slider_crank", gravity=(0, 0, 0), source=_SOURCE, guess=guess)
    crank = m.add(_bar("K1", 0.36, _CRANK, 0.002727))
    rod = m.add(_bar("K2", 0.151104, _ROD, 0.0045339259))
    slider = m.add(Body("K3", mass=0.075552))
    pin = Revolute("pin")
    m.connect(m.world, Revolute("crank", actuated=True), crank)
    m.connect(crank.at(_CRANK), Revolute("rod"), rod)
    m.connect(m.world, Prismatic("slide", axis="x"), slider)
    m.connect(rod.at(_ROD), pin, slider)
    m.cut(pin)
    return m


def _bar(name: str, mass: float, length: float, about_joint: float) -> Body:
    """Return a homogeneous bar from its reference frame along x.

    `mass` in [kg], `length` in [m], moment of inertia `about_joint` about its end in [kg m^2].
    """
    about_com = about_joint - mass * length**2 / 4
    return Body(name, mass=mass, com=(length / 2, 0, 0), inertia=(0, about_com, about_com))
