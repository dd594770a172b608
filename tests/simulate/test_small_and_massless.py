"""Mechanisms of any size, and links whose mass is set to zero."""

from functools import cache

import numpy as np
import pytest

import mbs
from mbs.components import Body, Box, Prismatic, Revolute, Spherical, Universal


@cache
def spatial_loop(size):
    m = mbs.Mechanism("rssr", gravity=(0, 0, -9.81 * size))
    crank, rod, rocker = (
        m.add(Box(name, length=size * x, width=0.02 * size, density=2700))
        for name, x in (("crank", 0.2), ("rod", 0.6), ("rocker", 0.4))
    )
    m.connect(m.world, Revolute("j1", actuated=True), crank.left)
    m.connect(crank.right, Universal("u"), rod.left)
    m.connect(rod.right, Spherical("s"), rocker.right)
    ground = m.world.at(0.3 * size, 0.3 * size, rotation=("x", "pi/2"))
    m.connect(ground, closing := Revolute("j2"), rocker.left)
    m.cut(closing)
    return m.assemble()


@cache
def crank_angles(size):
    """Of a motion from the configuration of size one."""
    start = [*spatial_loop(1.0).configuration]
    options = {"v0": {"j1": 5.0}, "tolerance": 1e-9, "quiet": True}
    return mbs.simulate.run(spatial_loop(size), 0.5, q0=start, **options)["j1.q"]


@pytest.mark.parametrize("size", [1e-2, 1e-3, 1e2])
def test_a_loop_of_another_size_moves_alike(size):
    """With gravity in proportion the motion does not depend on the size."""
    assert crank_angles(size) == pytest.approx(crank_angles(1.0), abs=1e-6)
    leads = [
        mbs.loops.configuration_report(spatial_loop(s), spatial_loop(1.0).configuration).leads
        for s in (1.0, size)
    ]
    assert leads[1] == pytest.approx(leads[0], rel=0.2)  # other rows may have been kept


def test_a_mass_that_is_set_to_zero_is_as_one_that_is_small():
    m = mbs.Mechanism("engine", gravity=(0, -9.81, 0), parameters={"M": 1.0, "J": 0.1})
    crank = m.add(Box("crank", length=0.4, width=0.03, mass=1))
    rod = m.add(Body("rod", mass="M", inertia=("J", "J", "J"), com=(0.45, 0, 0)))
    slider = m.add(Body("slider", mass=1.5))
    m.connect(m.world, Revolute("j1", actuated=True), crank.left)
    m.connect(crank.right, Revolute("j2"), rod)
    m.connect(rod.at(0.9), Revolute("j3"), slider)
    m.connect(m.world, Prismatic("s", axis="x"), slider)
    system = m.assemble(guess={"s": 1.2, "j1": 0.4})
    ends = [
        mbs.simulate.run(
            system, 0.5, parameters={"M": mass, "J": mass / 10}, tau={"j1": 1.0}, quiet=True
        )["j1.v"][-1]
        for mass in (0.0, 1e-9)
    ]
    assert np.isfinite(ends).all()
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)
