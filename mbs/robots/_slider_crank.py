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
    """Crank of 0.15 m, driven in `crank`, rod of 0.3 m, slider along x by `slide`; no gravity.

    It is assembled stretched, crank and rod along x; slide is the distance from the crank's axis.
    The published inertias are about the joints, j1 of the crank and j2 of the rod.

    Source: Simeon 1996; Mazzia & Magherini 2008, whose rod bends.
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
    about_com = about_joint - mass * length**2 / 4
    return Body(name, mass=mass, com=(length / 2, 0, 0), inertia=(0, about_com, about_com))
