"""Simulation of stiff mechanisms by the implicit method."""

from math import pi

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.components import PointMass, Prismatic, Spring
from mbs.errors import ModelError
from mbs.simulate import run


def coupled_masses():
    """1 kg on a spring of 50 N/m, and 1 kg tied to it by one of 1e9 N/m with much damping."""
    m = mbs.Mechanism("coupled", gravity=(0, 0, 0))
    first, second = m.add(PointMass("first", mass=1)), m.add(PointMass("second", mass=1))
    m.connect(m.world, Prismatic("x1", axis="x"), first)
    m.connect(m.world.at(1, 0, 0), Prismatic("x2", axis="x"), second)
    m.add(Spring("soft", m.world.at(-2, 0, 0), first.at(), stiffness=50, length=2, damping=0))
    m.add(Spring("tie", first.at(), second.at(), stiffness=1e9, length=1, damping=1e6))
    return m.assemble()


def test_a_stiff_tie_acts_as_a_weld():
    result = run(
        coupled_masses(), 4, q0={"x1": 0.3, "x2": 0.3}, method="rodas", tolerance=1e-9, quiet=True
    )
    expected = 0.3 * np.cos(5 * result.time)
    assert np.max(np.abs(result["x1.q"] - expected)) < 1e-6
    assert np.max(np.abs(result["x2.q"] - expected)) < 1e-6


def test_flyball_governor_is_the_same_by_both_methods():
    system = catalogue_system("flyball_governor")
    start = {"spin": 2 * pi}
    explicit, implicit = (
        run(system, 2, v0=start, method=method, tolerance=1e-8, quiet=True)
        for method in ("dopri5", "rodas")
    )
    for name in ("s.q", "spin.v", "alpha1.q", "alpha2.v"):
        assert np.max(np.abs(explicit[name] - implicit[name])) < 3e-8


def test_loops_stay_closed():
    system = catalogue_system("four_bar")
    explicit, implicit = (
        run(system, 2, method=method, quiet=True) for method in ("dopri5", "rodas")
    )
    assert np.max(implicit["closure_residual"]) < 1e-11
    name = f"{system.coordinates[0].name}.q"
    assert np.max(np.abs(explicit[name] - implicit[name])) < 1e-6


def test_unknown_method():
    with pytest.raises(ModelError, match="method is 'bdf'; use 'dopri5', or 'rodas'"):
        run(coupled_masses(), 1, method="bdf", quiet=True)
