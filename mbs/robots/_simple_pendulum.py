"""A point mass on a rod, problem A01 of the multibody benchmark library."""

from __future__ import annotations

from math import pi

from mbs.components import Body, PointMass, Revolute
from mbs.mechanism import Mechanism

_SOURCE = "Gonzalez, Dopico, Lugris & Cuadrado 2006, multibody benchmark library, problem A01"


def simple_pendulum() -> Mechanism:
    """Pendulum of 1 kg on a massless rod of 1 m, with gravity along -y.

    The rod is along x at theta = 0. The mechanism is assembled with the mass at x = -1 m, y = 0,
    where the benchmark starts at rest.

    Source: Gonzalez et al. 2006, problem A01.
    """
    m = Mechanism("simple_pendulum", gravity=(0, -9.81, 0), source=_SOURCE, guess={"theta": pi})
    rod, mass = m.add(Body("rod", mass=0)), m.add(PointMass("mass", mass=1))
    m.connect(m.world, Revolute("theta", axis="z", actuated=False), rod)
    m.connect(rod.at(1), mass)
    return m
