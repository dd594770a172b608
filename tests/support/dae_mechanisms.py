"""Mechanisms of every kind that differential-algebraic equations are made of."""

from __future__ import annotations

from support.catalogue_systems import catalogue_system
from support.closed_mechanisms import closed_chain
from support.random_trees import random_tree

from mbs import Mechanism
from mbs.components import (
    Body,
    Box,
    Damper,
    Free,
    JointFriction,
    Prismatic,
    Revolute,
    RollingDisc,
    Spherical,
    Spring,
)


def four_bar():
    """With a spring, a damper, Coulomb friction and a length that is a symbol."""
    m = Mechanism("four_bar", gravity=(0, -9.81, 0), parameters={"L": 1.0, "k": 30.0})
    a, b, c = (
        m.add(Box(n, length=x, width=0.05, mass=w))
        for n, x, w in (("a", 0.4, 2.0), ("b", "L", 3.0), ("c", 0.9, 2.0))
    )
    m.connect(m.world, Revolute("j1", actuated=True, Fv=0.1), a.left)
    m.connect(a.right, Revolute("j2"), b.left)
    m.connect(b.right, Revolute("j3"), c.right)
    m.connect(m.world.at(0.8), Revolute("j4"), c.left)
    m.add(Spring("spring", m.world.at(0, 1), b.at(0.3, 0.1), stiffness="k", length=0.2))
    m.add(Damper("damper", a.at(0.1), c.at(0.4), damping=2.0))
    m.add(JointFriction("friction", "j4", coulomb=0.3))
    return m.assemble(guess={"j2": 1.0})


def slider_crank(rod_mass=1.0, stiffness=0.0):
    """A crank, a rod that may have no mass, a slider along x; a spring turns the rod back."""
    m = Mechanism("slider_crank", gravity=(0, -9.81, 0))
    crank = m.add(Box("crank", length=0.4, width=0.03, mass=1))
    rod = m.add(
        Box("rod", length=0.9, width=0.03, mass=rod_mass) if rod_mass else Body("rod", mass=0)
    )
    slider = m.add(Body("slider", mass=1.5))
    m.connect(m.world, Revolute("j1", actuated=True), crank.left)
    m.connect(crank.right, Revolute("j2", stiffness=stiffness), rod.left if rod_mass else rod)
    m.connect(rod.right if rod_mass else rod.at(0.9), Revolute("j3"), slider)
    m.connect(m.world, Prismatic("s", axis="x"), slider)
    return m.assemble(guess={"s": 1.2, "j1": 0.4})


def rssr():
    """A spatial loop with a rod between two ball joints: quaternions, and a spin that is free."""
    m = Mechanism("rssr", gravity=(0, 0, -9.81))
    crank, rod, rocker = (
        m.add(Box(n, length=x, width=0.02, mass=1)) for n, x in (("a", 0.2), ("b", 0.6), ("c", 0.4))
    )
    m.connect(m.world, Revolute("j1", actuated=True), crank.left)
    m.connect(crank.right, Spherical("s1"), rod.left)
    m.connect(rod.right, Spherical("s2"), rocker.right)
    m.connect(m.world.at(0.3, 0.3, rotation=("x", "pi/2")), Revolute("j2"), rocker.left)
    return m.assemble(guess={"j2": 1.0})


def spatial(closing="universal"):
    """A random spatial chain of eight joints with friction and rotors, closed by a joint."""
    mechanism, guess = closed_chain(3, closing)
    return mechanism.assemble(guess=guess)


def floating():
    """A random tree on a floating base, its other joints driven."""
    return random_tree(31, n=3, kinds=("free", "revolute", "spherical")).mechanism.assemble()


def rolling():
    """A disc that rolls on a plane without slipping."""
    m = Mechanism("rolling")
    disc = m.add(Body("disc", mass=1.5, inertia=(0.015, 0.03, 0.015)))
    m.connect(m.world, Free("base"), disc)
    m.connect(m.world, RollingDisc("contact", radius=0.2), disc)
    return m.assemble({"base.z": 0.2})


def sr400():
    """An arm with a parallelogram."""
    return catalogue_system("sr400")


CLOSED = {
    "four_bar": four_bar,
    "slider_crank": slider_crank,
    "massless": lambda: slider_crank(0.0),
    "sr400": sr400,
    "universal": spatial,
    "revolute": lambda: spatial("revolute"),
    "rssr": rssr,
    "rolling": rolling,
}
"""By name what assembles a system with loops or rolling discs."""

OPEN = {"floating": floating, "rx90": lambda: catalogue_system("rx90")}
"""By name what assembles a system without."""
