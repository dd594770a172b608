"""Configurations are followed along their branch, or looked for near a guess."""

import casadi
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
import mbs.models
from mbs import Mechanism
from mbs.components import (
    Body,
    Box,
    Prismatic,
    Revolute,
)
from mbs.errors import AssemblyError, ModelError, Unclosable
from mbs.loops import assembly_modes, closure_residual, solve
from mbs.loops.closing import TOLERANCE, Closing, closure_parameters
from mbs.loops.closure_equations import facing
from mbs.loops.configuration import starts
from mbs.loops.plan import branches_at, plan
from mbs.solvers.least_squares import gauss_newton


def four_bar():
    return catalogue_system("four_bar")


def elbow(q, a=0.4, b=1.0, c=0.9, ground=0.8):
    """Which side of the line from the crank's end to the rocker's pivot the coupler is on."""
    end = a * np.array([np.cos(q[0]), np.sin(q[0])])
    coupler = b * np.array([np.cos(q[0] + q[1]), np.sin(q[0] + q[1])])
    across = np.array([ground, 0]) - end
    return np.sign(across[0] * coupler[1] - across[1] * coupler[0])


@pytest.mark.sweep
@pytest.mark.parametrize("angle", np.linspace(-6.2, 6.2, 25))
def test_a_full_turn_stays_on_the_branch(angle):
    system = four_bar()
    q = solve(system, {"j1": angle})
    assert q[0] == angle
    assert np.abs(np.array(closure_residual(system)(q))).max() < 1e-12
    assert elbow(q) == elbow(system.configuration)
    assert np.abs(q[1:]).max() < 8
    T = np.array(mbs.models.direct_geometry(system, "b")(angle))
    np.testing.assert_allclose(T, np.array(mbs.models.transform(system, "b")(q)), atol=1e-9)


@pytest.mark.parametrize(("j2", "root"), [(-1.0, -1.695449), (-1.7, -1.695449), (2.0, 0.544084)])
def test_a_guess_of_one_joint_leads_to_the_nearest_root_without_turns(j2, root):
    q = solve(catalogue_system("four_bar"), {"j1": 0.3}, guess={"j2": j2})
    assert q[1] == pytest.approx(root, abs=1e-6)
    assert abs(q[2]) < 2 * np.pi


def test_a_guess_chooses_the_other_branch():
    system = four_bar()
    q = solve(system, {"j1": 0.3}, guess={"j2": -1.7, "j4": -1.8})
    assert elbow(q) == -elbow(system.configuration)
    assert np.abs(np.array(closure_residual(system)(q))).max() < 1e-12


def test_positions_of_dependent_joints():
    q = solve(four_bar(), {"j4": 1.5})
    assert q[2] == 1.5
    with pytest.raises(Unclosable, match=r"j4 = 1\.1 cannot be reached .* ends near j4 = 1\.2"):
        solve(four_bar(), {"j4": 1.1})


def test_values_that_are_no_positions():
    system = four_bar()
    with pytest.raises(ModelError, match="the position of j1 is nan; give a finite number"):
        solve(system, {"j1": np.nan})
    with pytest.raises(ModelError, match="q_active has 2 values, the independent joints are 1: j1"):
        solve(system, [0.3, 0.4])
    with pytest.raises(AssemblyError, match="the guess of j2 is nan; give one finite number"):
        mbs.load("four_bar").assemble(guess={"j2": np.nan})


def test_parameters_move_the_configuration():
    m = Mechanism("rocker", gravity=(0, -9.81, 0), parameters={"L": 0.9, "rho": 2700})
    a, b, c = (
        m.add(Box(n, length=x, width=0.05, density="rho"))
        for n, x in (("a", 0.4), ("b", 1.0), ("c", "L"))
    )
    m.connect(m.world, Revolute("j1", actuated=True), a.left)
    m.connect(a.right, Revolute("j2"), b.left)
    m.connect(b.right, Revolute("j3"), c.right)
    m.connect(m.world.at(0.8), Revolute("j4"), c.left)
    system = m.assemble(guess={"j2": 1.0})
    for length in (0.8, 1.1):
        q = solve(system, {"j1": 0.5}, parameters={"L": length})
        assert np.abs(np.array(closure_residual(system)(q, [2700, length]))).max() < 1e-12
        assert elbow(q, c=length) == elbow(system.configuration)


def test_a_symbol_that_is_not_in_the_loop_needs_no_value():
    m = Mechanism("light", gravity=(0, -9.81, 0))
    a, b, c = (m.add(Body(n, mass=f"m_{n}", inertia=(0, 0, "J"))) for n in "abc")
    m.connect(m.world, Revolute("j1", actuated=True), a)
    m.connect(a.at(0.4), Revolute("j2"), b)
    m.connect(b.at(1.0), Revolute("j3"), c.at(0.9))
    m.connect(m.world.at(0.8), Revolute("j4"), c)
    system = m.assemble(guess={"j2": 1.0})
    q = solve(system, {"j1": 0.4})
    idm = mbs.models.inverse_dynamics(system)
    assert np.isfinite(float(idm(q, 1.0, 1.0, [1.0, 0.1, 2.0, 3.0])))
    with pytest.raises(ModelError, match=r"parameters 'm_a', .* have no value; give them"):
        idm(q, 1.0, 1.0)


def test_closed_geometry_is_differentiable_and_refuses_what_it_cannot_reach():
    system = four_bar()
    dgm = mbs.models.direct_geometry(system, "c")
    x = casadi.MX.sym("x")
    slope = casadi.Function("slope", [x], [casadi.jacobian(dgm(x), x)])
    h = 1e-6
    difference = (np.array(dgm(0.7 + h)) - np.array(dgm(0.7 - h))) / (2 * h)
    np.testing.assert_allclose(np.array(slope(0.7)).ravel(), difference.ravel(order="F"), atol=1e-7)
    with pytest.raises(ModelError, match=r"dgm\(four_bar\): q_a is not finite"):
        dgm(np.nan)
    m = Mechanism("rockers")
    a, b, c = (m.add(Box(n, length=x, mass=1)) for n, x in (("a", 0.6), ("b", 0.3), ("c", 0.7)))
    m.connect(m.world, Revolute("j1", actuated=True), a.left)
    m.connect(a.right, Revolute("j2"), b.left)
    m.connect(b.right, Revolute("j3"), c.right)
    m.connect(m.world.at(0.8), Revolute("j4"), c.left)
    rockers = m.assemble(guess={"j1": 1.2, "j2": -1.0})
    with pytest.raises(Unclosable, match=r"no configuration on this branch has j1 = 3; j1 can be"):
        mbs.models.direct_geometry(rockers)([3.0])


@pytest.mark.parametrize("q7", [-2.0, 1.97, 3.1])
def test_a_parallelogram_goes_straight_through_its_flat_configuration(q7):
    """At the flat configuration two branches meet; the one that continues is taken."""
    system = catalogue_system("sr400")
    q = solve(system, {"q7": q7})
    assert q[2] == pytest.approx(np.pi / 2 - q[1] + q7, abs=1e-9)
    assert q[7] == pytest.approx(q[1] - q7, abs=1e-9)
    active = [
        q[[c.name for c in system.coordinates].index(system.velocity_coordinates[k].name)]
        for k in system.independent
    ]
    T = np.array(mbs.models.direct_geometry(system, 8)(active))
    np.testing.assert_allclose(T, np.array(mbs.models.transform(system, 8)(q)), atol=1e-9)


def test_values_of_wrong_kinds():
    system = four_bar()
    for call, message in (
        (lambda: solve(system, "a"), "q_active is 'a'; give numbers for j1"),
        (lambda: solve(system, None, guess=3), "guess is 3; give a dict"),
        (lambda: solve(system, None, parameters=[1]), "the parameters are .*; give a dict"),
        (lambda: solve(system, {"j1": [1.0, 2.0]}), "the position of j1 has 2 values; give one"),
        (lambda: solve(None), "is not a System"),
    ):
        with pytest.raises(ModelError, match=message):
            call()
    with pytest.raises(Unclosable, match="give one less than 400 away"):
        solve(system, {"j1": 1e8})


def test_starts_go_further_and_further_to_half_a_turn():
    first, free = np.full(1000, 0.5), list(range(0, 1000, 2))
    drawn = list(starts(first, free, 9))
    assert np.array_equal(drawn[0], first)
    eighths = []
    for q in drawn[1:]:
        assert np.array_equal(q[1::2], first[1::2])
        eighths.append(8 * np.max(np.abs(q - first)) / np.pi)
    # the farthest of 500 even draws is within a hundredth of the limit
    reach = np.array([2, 3, 4, 5, 6, 7, 8, 8, 8])
    assert np.all((0.98 * reach < eighths) & (eighths <= reach))


@pytest.mark.parametrize(("away", "led"), [(3e-6, True), (3e-5, False)])
def test_ways_lead_to_a_configuration_to_a_hundred_thousandth(away, led):
    system = mbs.load("four_bar").assemble()
    q = np.array(system.configuration)
    q[list(system.closure.passive)] += away
    stages = plan(system)
    assert len(stages) > 0
    assert len(branches_at(system, stages, q, np.array(system.p_default))) == led * len(stages)


@pytest.mark.parametrize("name", ["four_bar", "bricard"])
def test_axes_of_a_revolute_cut_must_face_one_way(name):
    system = mbs.load(name).assemble()
    q = casadi.SX.sym("q", system.nq)
    cosines = casadi.Function("cosines", [q], [facing(system, q)])(system.configuration)
    np.testing.assert_allclose(np.array(cosines), [[1.0]], atol=1e-12, strict=True)


def test_all_axes_of_a_prismatic_cut_must_face_one_way():
    m = Mechanism("stage")
    a, b, c = (m.add(Body(name, mass=1.0, inertia=(1, 1, 1))) for name in "abc")
    m.connect(m.world, Prismatic("j1", axis="x", actuated=True), a)
    m.connect(a, Prismatic("j2", axis="y", actuated=True), b)
    m.connect(m.world, Prismatic("j3", axis="y"), c)
    m.connect(c, Prismatic("j4", axis="x"), b)
    system = m.assemble()
    q = casadi.SX.sym("q", system.nq)
    cosines = casadi.Function("cosines", [q], [facing(system, q)])(system.configuration)
    np.testing.assert_array_equal(np.array(cosines), np.ones((3, 1)), strict=True)


def test_a_mode_tells_its_largest_row():
    system = mbs.load("four_bar").assemble()
    rows = closure_residual(system)
    found = [assembly_modes(system, {"j1": x}) for x in (0.3, 1.1, 2.0)]
    told = [mode.residual for some in found for mode in some]
    largest = [np.abs(np.array(rows(mode.q))).max() for some in found for mode in some]
    np.testing.assert_allclose(told, largest, rtol=1e-12)
    assert max(told) > 0


@pytest.mark.parametrize("name", ["four_bar", "delta"])
def test_functions_of_casadi_and_of_python_close_to_the_same_bits(name):
    """From near and from afar, closed or not, with locked positions."""
    system = catalogue_system(name)
    p, everything = closure_parameters(system), tuple(range(system.nq))
    q0, rng = np.array(system.configuration), np.random.default_rng(2)
    trials = [q0 + reach * rng.normal(size=system.nq) for reach in (0, 1e-6, 1e-3, 0.1, 1, 3)]
    closed = set()
    for closing in (Closing(system, p, locked) for locked in ((), (0,), everything)):
        free = closing.free

        def rows(x, q, closing=closing, free=free):
            at = q.copy()
            at[free] = x
            return closing.rows(at)

        for q in trials:
            found = closing.nearest(q)
            tolerance = TOLERANCE * closing.sizes
            root = gauss_newton(lambda x: rows(x, q), q[free], tolerance=tolerance)  # noqa: B023
            assert found.q[free].tobytes() == root.x.tobytes()
            assert found.residual == root.residual
            closed.add(found.is_closed)
    assert closed == {True, False}
