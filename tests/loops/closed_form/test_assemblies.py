"""Loops with balls and universal joints, as Modelica's joint assemblies: any cut, any make."""

import casadi
import numpy as np
import pytest
from support.configurations import active, same, searched
from support.ring_loops import MADE_OF, ring_loop

from mbs.assembly.tree import quaternion_slices
from mbs.errors import Unclosable
from mbs.loops import assembly_modes, function, reduction_matrix, solve

SEARCHED = (
    *("RSUR", "PSUR", "RSUP", "PUSP"),  # SSR and SSP, one ball a universal joint
    *("RRUS", "PRSU", "RUPS", "RSPU"),  # USR, USP and UPS
    *("RVSR", "RVPS", "RUWR", "RWPV"),  # the same, made of turns
    *("RCCC", "RRPRPRP"),
    *("RSPPP", "RWPPP", "RPPRS"),
)
LISTED = ("RUSR", "PUSR", "RUSP", "PSUP", "RURS", "RPUS", "PUPS", "RWUR", "RUWP", "RUPW", "PCCC")
PARALLEL = [
    ("RRRRS", ((1, 2),)),
    ("RRRRS", ((2, 3),)),
    ("RRRRW", ((1, 2),)),
    ("RRXRS", ((2, 1),)),
    ("RXRRS", ((2, 1),)),
    ("RRPRS", ((1, 2), (1, 3))),
    ("RXRPS", ((2, 1), (2, 3))),
]


def check_modes(system):
    """All of them close, and have the derivatives of the implicit function theorem."""
    q_a = active(system)
    listed = assembly_modes(system, q_a)
    assert max(mode.residual for mode in listed) < 1e-12
    assert any(same(system, mode.q, system.configuration) for mode in listed)
    for mode in listed[:2]:
        check_slope(system, mode, q_a)
    return listed


def check_count(system, starts=60):
    """Modes against a search."""
    q_a = active(system)
    listed, found = check_modes(system), searched(system, q_a, starts=starts)
    assert len(listed) == len(found) > 0
    assert all(any(same(system, mode.q, q) for q in found) for mode in listed)


def check_slope(system, mode, q_a):
    """The derivative of a closed form is that of the rates, dq/dt = N G v_a."""
    x, v = casadi.SX.sym("x", len(q_a)), casadi.SX.sym("v", system.nv)
    slope = casadi.jacobian(function(system, mode.branch)(x), x)
    q = np.array(mode.q)
    N = casadi.Function("N", [v], [casadi.jacobian(system.qdot(q, v), v)])(0)
    wanted = np.array(N) @ np.array(reduction_matrix(system)(q))
    G = np.array(casadi.Function("G", [x], [slope])(q_a))
    np.testing.assert_allclose(G, wanted, atol=1e-8 * max(1.0, np.abs(wanted).max()))


@pytest.mark.sweep
@pytest.mark.parametrize("kinds", SEARCHED)
def test_the_modes_are_those_that_a_search_finds(kinds):
    check_count(ring_loop(1, kinds).assemble())


@pytest.mark.sweep
@pytest.mark.parametrize("kinds", LISTED)
def test_the_same_joints_in_another_order(kinds):
    listed = check_modes(ring_loop(1, kinds).assemble())
    assert len(listed) in (2, 4)


@pytest.mark.sweep
@pytest.mark.parametrize(("kinds", "parallel"), PARALLEL)
def test_a_ball_in_a_plane_of_parallel_joints(kinds, parallel):
    check_count(ring_loop(1, kinds, parallel=parallel).assemble(), starts=150)


@pytest.mark.sweep
@pytest.mark.parametrize("kinds", ["RUSR", "RUPS", "RWVR", "RRCPC", "RWPPP", "RRRRS"])
def test_any_joint_may_be_cut(kinds):
    count = sum(len(MADE_OF.get(kind, kind)) for kind in kinds)
    parallel = ((1, 2),) if kinds == "RRRRS" else ()
    numbers = set()
    for cut in range(1, count):
        numbers.add(len(check_modes(ring_loop(1, kinds, cut=cut, parallel=parallel).assemble())))
    assert len(numbers) == 1


@pytest.mark.parametrize(
    ("kinds", "driven"), [("RWVR", 6), ("RRPRPRP", 1), ("RRPRPRP", 3), ("RPWV", 1)]
)
def test_another_joint_may_be_driven(kinds, driven):
    check_count(ring_loop(2, kinds, (driven,)).assemble())


def test_a_quaternion_is_of_unit_length_and_its_first_element_is_not_negative():
    system = ring_loop(1, "RUSR", cut=1).assemble()
    (part,) = quaternion_slices(system.tree)
    for mode in assembly_modes(system):
        assert abs(np.linalg.norm(mode.q[part]) - 1) < 1e-14
        assert mode.q[part.start] >= 0
    followed = solve(system, {"j0": 0.05})
    assert same(system, solve(system, {"j0": 0.05}, branch=[]), followed, 1e-8)


@pytest.mark.parametrize(("kinds", "unit"), [("RUSR", "rad"), ("PUSR", "m"), ("PCCC", "m")])
def test_out_of_reach_the_range_is_named(kinds, unit):
    system = ring_loop(1, kinds).assemble()
    reach = np.linspace(-np.pi, np.pi, 60) if unit == "rad" else np.linspace(-60, 60, 60)
    lost = [x for x in reach if not assembly_modes(system, [x])]
    if not lost:
        assert kinds == "PCCC"  # angles do not depend on the slide
        return
    with pytest.raises(Unclosable, match=rf"j0 can be -?\d.* to -?\d.* {unit}$") as error:
        solve(system, [lost[0]], branch=[])
    low, high = (float(text) for text in str(error.value).split("can be ")[1].split()[:3:2])
    middle = (low + high) / 2
    assert np.isfinite(solve(system, [middle], branch=[])).all()
