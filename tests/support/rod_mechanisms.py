"""Mechanisms of thin rods whose optimal motions are known."""

from mbs import Mechanism
from mbs.components import Body, Revolute


def rod(m, name, length, mass):
    """A thin rod along x from its reference point."""
    across = mass * length**2 / 12
    return m.add(Body(name, mass=mass, com=(length / 2, 0, 0), inertia=(1e-9, across, across)))


def acrobot():
    """Two rods of 1 m and 1 kg, the motor at the elbow."""
    m = Mechanism("acrobot", gravity=(0, -9.81, 0))
    upper, lower = (rod(m, name, 1.0, 1.0) for name in ("upper", "lower"))
    m.connect(m.world, Revolute("shoulder", actuated=False), upper)
    m.connect(upper.at(1.0), Revolute("elbow", actuated=True), lower)
    return m.assemble()


def four_bar():
    """Crank 0.25, coupler 0.8, rocker 0.7 and ground 1.0 m; rods of 1, 3 and 2 kg."""
    m = Mechanism("four_bar", gravity=(0, -9.81, 0))
    sizes = (("crank", 0.25, 1.0), ("coupler", 0.8, 3.0), ("rocker", 0.7, 2.0))
    crank, coupler, rocker = (rod(m, *size) for size in sizes)
    m.connect(m.world, Revolute("j1", actuated=True), crank)
    m.connect(crank.at(0.25), Revolute("j2"), coupler)
    m.connect(coupler.at(0.8), Revolute("j3"), rocker.at(0.7))
    m.connect(m.world.at(1.0), Revolute("j4"), rocker)
    return m.assemble(guess={"j1": 0.3, "j2": 0.8, "j4": 1.5})
