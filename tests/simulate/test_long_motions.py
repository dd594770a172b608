"""Closed loops over a long time, and by different models of one mechanism."""

import numpy as np
import pytest

import mbs
from mbs.components import Body, Cylindrical, PointOnLine, Revolute, Spherical
from mbs.robots import n_four_bar


def test_a_four_bar_keeps_loop_energy_and_branch_for_a_thousand_seconds():
    """Over 500 turns, each through two singular configurations."""
    system = n_four_bar(1).assemble()
    result = mbs.simulate.run(system, 1000.0, v0={"a0": -1.0}, step=0.1, tolerance=1e-9, quiet=True)
    assert np.ptp(result["a0.q"]) > 1000 * np.pi
    assert result["closure_residual"].max() < 1e-10
    energy = result["kinetic_energy"] + result["potential_energy"]
    assert np.ptp(energy) < 1e-4 * result["kinetic_energy"].max()
    assert np.abs(result["a0.q"] - result["a1.q"]).max() < 1e-9


def rocker_crank(closing):
    m = mbs.Mechanism("m", gravity=(0, -9.81, 0))
    rods = [m.add(Body(n, mass=1, com=(0.3, 0, 0), inertia=(0.01, 0.1, 0.1))) for n in "abc"]
    a, b, c = rods
    m.connect(m.world, Revolute("j1", actuated=True), a)
    m.connect(a.at(0.4), Revolute("j2"), b)
    m.connect(m.world.at(0.8), Revolute("j4"), c)
    m.connect(b.at(1.0), closing, c.at(0.9))
    m.cut(closing)
    return m.assemble(guess={"j1": 0.5, "j2": 0.6, "j4": 1.2})


@pytest.mark.parametrize(
    ("closing", "redundant"),
    [(Revolute("j3"), 3), (Cylindrical("j3"), 2), (Spherical("j3"), 1), (PointOnLine("j3"), 0)],
    ids=["revolute", "cylindrical", "spherical", "line"],
)
def test_models_with_and_without_redundant_rows_move_alike(closing, redundant):
    system = rocker_crank(closing)
    assert len(system.loops[0].dropped) == redundant
    reference = rocker_crank(PointOnLine("j3"))
    start = {"j1": 0.5}
    found, wanted = (
        mbs.simulate.run(s, 3.0, q0=start, v0={"j1": 9.0}, tolerance=1e-10, quiet=True)
        for s in (system, reference)
    )
    for name in ("j1.q", "j2.q", "j4.q"):
        assert found[name] == pytest.approx(wanted[name], abs=1e-8)
    assert np.ptp(found["j1.q"]) > 2 * np.pi
