"""Loops that no special kernel fits, by Paul's method."""

import casadi
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.configurations import active, same, searched
from support.ring_loops import ring_loop

from mbs import Mechanism, Parameter
from mbs.components import Body, Revolute, Spherical
from mbs.errors import NoClosedForm, Unclosable
from mbs.loops import assembly_modes, function, reduction_matrix, solve
from mbs.loops.plan import plan

PARALLEL = ((1, 2), (1, 3))

# A loop, and the ways of its one stage.
SPATIAL = [
    ("RRRRS", (), 4),
    ("RRRPS", (), 4),
    ("RRRRW", (), 8),
    ("RRRRUR", PARALLEL, 8),
    ("RRRRRC", PARALLEL, 4),
]


def askew(length=0.5):
    """A crank that holds the hand of an arm of three turns askew, joined by a ball."""
    m = Mechanism("askew", guess={"drive": 0.3, "a": -1.3, "b": 3.1, "c": -3.1})
    crank, one, two, hand = (m.add(Body(n, mass=1.0, inertia=(0.1, 0.1, 0.1))) for n in "ABCD")
    m.connect(m.world, Revolute("drive", axis="z", actuated=True), crank)
    m.connect(m.world.at(0.8, -0.3, 0.4), Revolute("a", axis="y"), one)
    m.connect(one.at(0.1, 0.2, 0.15), Revolute("b", axis="z"), two)
    m.connect(two.at(length, 0.1), Revolute("c", axis="x"), hand)
    ball = Spherical("ball")
    m.connect(hand.at(0.1, 0.4, -0.2), ball, crank.at(0.4, 0.1))
    m.cut(ball)
    return m.assemble()


@pytest.mark.parametrize(("kinds", "parallel", "ways"), SPATIAL)
def test_the_modes_are_those_that_a_search_finds(kinds, parallel, ways):
    system = ring_loop(1, kinds, parallel=parallel).assemble()
    assert [len(stage.labels) for stage in plan(system)] == [ways]
    q_a = active(system)
    listed, found = assembly_modes(system, q_a), searched(system, q_a, starts=100)
    assert len(listed) == len(found) > 1
    assert all(any(same(system, mode.q, q) for q in found) for mode in listed)
    assert max(mode.residual for mode in listed) < 1e-11


def test_derivatives_of_a_branch():
    system = ring_loop(1, "RRRRW").assemble()
    q_a, x = active(system), casadi.SX.sym("x", 1)
    for mode in assembly_modes(system, q_a):
        slope = casadi.jacobian(function(system, mode.branch)(x), x)
        G = np.array(casadi.Function("G", [x], [slope])(q_a))
        wanted = np.array(reduction_matrix(system)(list(mode.q)))
        np.testing.assert_allclose(G, wanted, atol=1e-7 * max(1.0, np.abs(wanted).max()))


def test_lengths_stay_symbols():
    symbolic, q_a = askew(Parameter("L", 0.5)), [0.2]
    for length in (0.5, 0.48):
        plain, checked = askew(length), 0
        for mode in assembly_modes(plain, q_a):
            q = np.array(function(symbolic, mode.branch)(q_a, [length])).ravel()
            checked += same(plain, mode.q, q, 1e-9)
        assert checked == len(assembly_modes(plain, q_a)) > 1


def test_out_of_reach_there_is_no_configuration():
    system = askew()
    loops = function(system)
    q = np.array(loops([0.3])).ravel()
    assert same(system, q, system.configuration, 1e-8)
    assert assembly_modes(system, [2.0]) == []
    with pytest.raises(Unclosable, match="drive can be"):
        loops([2.0])
    x = casadi.SX.sym("x")
    assert not np.any(np.isfinite(np.array(casadi.Function("f", [x], [loops(x)])(2.0))[1:]))


@pytest.mark.parametrize(
    ("kinds", "reason"),
    [
        ("RRRRRRR", "more than two unknowns"),
        ("RCCRR", "fit no type of equation"),
    ],
)
def test_what_stays_refused_says_why(kinds, reason):
    with pytest.raises(NoClosedForm, match=reason):
        plan(ring_loop(1, kinds).assemble())


def test_a_loop_that_others_must_hold_is_not_searched():
    with pytest.raises(NoClosedForm, match="they can move while all that is known stays"):
        plan(catalogue_system("differential_wrist"))


def test_a_branch_agrees_with_newton():
    system = ring_loop(1, "RRRRS").assemble()
    q = solve(system, {"j0": 0.05}, branch=[])
    assert same(system, q, solve(system, {"j0": 0.05}), 1e-8)
