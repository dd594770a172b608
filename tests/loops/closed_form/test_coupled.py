"""Loops that share joints, parallelograms, gears and lengths that are symbols."""

import casadi
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.configurations import active, same, searched
from support.flat_loops import flat_loop

from mbs import Mechanism, Parameter
from mbs.components import Body, Coupling, Custom, Prismatic, Revolute, custom
from mbs.errors import LoopError, NoClosedForm
from mbs.loops import assembly_modes, closure_residual, function, reduction_matrix, solve
from mbs.loops.plan import plan, plan_from

LENGTHS = {"crank": 0.5, "coupler": 1.0, "rocker": 0.7, "ground": 0.9}
EQUAL = {"crank": 0.5, "coupler": 1.0, "rocker": 0.5, "ground": 1.0}

OWN = {name: name for name in LENGTHS}
SAME = {"crank": "a", "coupler": "b", "rocker": "a", "ground": "b"}


def bar(m, name):
    return m.add(Body(name, mass=1.0, com=(0.5, 0, 0), inertia=(0.1, 0.1, 0.1)))


def four_bars(count, lengths, guess=1.2, symbols=None):
    """Four-bars in a row, the rocker of one the crank of the next, cut between link and rocker.

    Args:
        count: how many.
        lengths: of crank, coupler, rocker and ground.
        guess: angle of every crank and rocker.
        symbols: the parameter for each length, numbers being left where there is none.
    """
    turned = {f"r{k}": guess for k in range(count + 1)}
    turned |= {f"c{k}": -guess for k in range(1, count + 1)}
    m = Mechanism("row", gravity=(0, -9.81, 0), guess=turned)

    def length(name, factor=1):
        if not symbols:
            return factor * lengths[name]
        symbol = symbols[name]
        return Parameter(symbol, lengths[name]) if factor == 1 else f"{factor} * {symbol}"

    before = bar(m, "bar0")
    m.connect(m.world, Revolute("r0", actuated=True), before)
    for k in range(1, count + 1):
        link, follower = bar(m, f"link{k}"), bar(m, f"bar{k}")
        m.connect(before.at(length("crank" if k == 1 else "rocker")), Revolute(f"c{k}"), link)
        m.connect(m.world.at(length("ground", k)), Revolute(f"r{k}"), follower)
        closing = Revolute(f"x{k}")
        m.connect(link.at(length("coupler")), closing, follower.at(length("rocker")))
        m.cut(closing)
        before = follower
    return m.assemble()


def test_a_row_of_four_bars_is_solved_one_after_the_other():
    system = four_bars(3, LENGTHS)
    assert [stage.name for stage in plan(system)] == ["x1", "x2", "x3"]
    listed = assembly_modes(system, {"r0": 1.1})
    found = searched(system, [1.1], starts=600)
    assert len(listed) == len(found) > 2
    assert all(any(same(system, mode.q, q) for q in found) for mode in listed)
    assert all(len(mode.branch) == 3 for mode in listed)


def test_a_loop_that_no_label_names_stays_as_it_was_assembled():
    system = four_bars(3, LENGTHS)
    assembled = [stage.labels[stage.chosen] for stage in plan(system)]
    other = "x2:+" if "x2:-" in assembled else "x2:-"
    q = solve(system, {"r0": 1.2}, branch=other)
    (mode,) = (mode for mode in assembly_modes(system, {"r0": 1.2}) if same(system, mode.q, q))
    assert mode.branch == (assembled[0], other, assembled[2])
    text = ", ".join(mode.branch)
    np.testing.assert_array_equal(solve(system, {"r0": 1.2}, branch=text), q)


@pytest.mark.parametrize("symbols", [None, SAME])
def test_a_parallelogram_keeps_its_label_through_the_flat_configuration(symbols):
    system = four_bars(1, EQUAL, symbols=symbols)
    (stage,) = plan(system)
    assert stage.labels == ("x1:parallel", "x1:crossed")
    assert stage.chosen == 0
    f = function(system, "x1:parallel")
    q = np.array([np.array(f(x)).ravel() for x in np.linspace(-3, 3, 41)])
    np.testing.assert_allclose(q[:, 2], q[:, 0], atol=1e-14)  # r1 = r0
    np.testing.assert_allclose(q[:, 1], -q[:, 0], atol=1e-14)
    x = casadi.SX.sym("x")
    arguments = [x, casadi.DM(system.parameter_values())] if symbols else [x]
    slope = casadi.Function("slope", [x], [casadi.jacobian(f(*arguments), x)])
    np.testing.assert_allclose(np.array(slope(0.0)).ravel(), [1, -1, 1], atol=1e-14)


def test_the_parallelogram_that_crosses():
    system = four_bars(1, EQUAL)
    listed, found = assembly_modes(system, {"r0": 0.8}), searched(system, [0.8])
    assert len(listed) == len(found) == 2
    assert all(any(same(system, mode.q, q) for q in found) for mode in listed)
    (crossed,) = (mode for mode in listed if mode.branch == ("x1:crossed",))
    assert crossed.q[2] < 0
    assert len(assembly_modes(system, {"r0": 0.0})) == 1  # the two meet


def test_a_row_of_parallelograms_of_any_length():
    system = four_bars(12, EQUAL)
    q = np.array(function(system)(0.4)).ravel()
    names = [coordinate.name for coordinate in system.coordinates]
    expected = [-0.4 if name.startswith("c") else 0.4 for name in names]
    np.testing.assert_allclose(q, expected, atol=1e-13)


def test_too_many_branches_are_not_listed():
    with pytest.raises(LoopError, match="row: 8192 branches are too many to list; name one"):
        assembly_modes(four_bars(13, EQUAL))


def test_lengths_stay_symbols():
    system = four_bars(2, LENGTHS, symbols=OWN)
    f = function(system)
    assert f.name_in() == ["q_a", "p"]
    numbers = function(four_bars(2, LENGTHS))
    np.testing.assert_allclose(np.array(f(1.2)), np.array(numbers(1.2)), atol=1e-14)
    values = dict(crank=0.45, coupler=1.1, rocker=0.75, ground=0.8)
    other = function(four_bars(2, values))
    p = system.parameter_values(values)
    np.testing.assert_allclose(np.array(f(1.2, p)), np.array(other(1.2)), atol=1e-13)
    q = solve(system, {"r0": 1.2}, branch=[], parameters=values)
    np.testing.assert_allclose(q, np.array(f(1.2, p)).ravel(), atol=1e-14)
    assert np.abs(np.array(closure_residual(system)(q, p))).max() < 1e-13
    (mode, *_) = assembly_modes(system, {"r0": 1.2}, parameters=values)
    assert mode.residual < 1e-13


def test_equal_lengths_of_two_names_are_no_parallelogram():
    (stage,) = plan(four_bars(1, EQUAL, symbols=OWN))
    assert stage.labels == ("x1:+", "x1:-")


def test_derivatives_by_lengths():
    system = four_bars(2, LENGTHS, symbols=OWN)
    f, p = function(system), np.array(system.parameter_values())
    p_s = casadi.SX.sym("p", p.size)
    slope = np.array(casadi.Function("s", [p_s], [casadi.jacobian(f(1.1, p_s), p_s)])(p))
    for k in range(p.size):
        step = np.eye(p.size)[k] * 1e-6
        difference = (np.array(f(1.1, p + step)) - np.array(f(1.1, p - step))).ravel() / 2e-6
        np.testing.assert_allclose(slope[:, k], difference, atol=1e-8)


def test_sr400():
    system = catalogue_system("sr400")
    rng = np.random.default_rng(4)
    f = function(system)
    for _ in range(5):
        q_a = active(system) + rng.uniform(-0.5, 0.5, 6)
        q = np.array(f(q_a)).ravel()
        names = [coordinate.name for coordinate in system.coordinates]
        at = dict(zip(names, q, strict=True))
        for got, wanted in (
            (at["q3"], np.pi / 2 - at["q2"] + at["q7"]),
            (at["q8"], at["q2"] - at["q7"]),
        ):
            assert abs(np.remainder(got - wanted + np.pi, 2 * np.pi) - np.pi) < 1e-13
        assert same(system, q, solve(system, list(q_a)), 1e-8)
        G = casadi.Function("G", [x := casadi.SX.sym("x", 6)], [casadi.jacobian(f(x), x)])
        np.testing.assert_allclose(
            np.array(G(q_a)), np.array(reduction_matrix(system)(q)), atol=1e-10
        )


def test_a_gear_leads_into_a_loop():
    m = Mechanism("geared", gravity=(0, -9.81, 0), guess={"c1": 0.5, "r1": 1.0})
    motor, crank, link, rocker = (bar(m, name) for name in ("motor", "crank", "link", "rocker"))
    m.connect(m.world.at(0, 2, 0), Revolute("motor_turn", actuated=True), motor)
    m.connect(m.world, Revolute("r0"), crank)
    m.add(Coupling("gear", driven="r0", driver="motor_turn", coefficients=(0.4, -0.5, 0.1)))
    m.connect(crank.at(0.4), Revolute("c1"), link)
    m.connect(m.world.at(0.9), Revolute("r1"), rocker)
    m.connect(link.at(1.0), Revolute("x1"), rocker.at(0.7))
    system = m.assemble()
    assert [stage.name for stage in plan(system)] == ["gear", plan(system)[1].name]
    listed = assembly_modes(system, {"motor_turn": 0.3})
    found = searched(system, [0.3])
    assert len(listed) == len(found) == 2
    for mode in listed:
        at = dict(zip([c.name for c in system.coordinates], mode.q, strict=True))
        assert abs(at["r0"] - (0.4 - 0.15 + 0.009)) < 1e-15


def test_a_gear_backwards():
    m = Mechanism("gears")
    for k in range(2):
        m.connect(m.world.at(k), Revolute(f"g{k}", actuated=k == 1), bar(m, f"wheel{k}"))
    m.add(Coupling("mesh", driven="g1", driver="g0", coefficients=(0.2, -2.0)))
    np.testing.assert_allclose(np.array(function(m.assemble())(1.0)).ravel(), [-0.4, 1.0])


def test_an_open_chain_has_one_mode():
    system = catalogue_system("scara")
    (mode,) = assembly_modes(system, [0.1, 0.2, 0.3, 0.4])
    assert mode.q == (0.1, 0.2, 0.3, 0.4)
    assert mode.branch == ()


def test_a_loop_of_slides_has_one_mode():
    (mode,) = assembly_modes(flat_loop(8, "RRPP", (0,)).assemble())
    assert mode.branch == ()


class Line(Custom):
    """Two coordinates on a straight line: a row that is linear in both."""

    x = custom.coordinate()
    y = custom.coordinate()

    def rows(self, at):
        return {"line": at.x.q + 2 * at.y.q - 0.3}


def test_a_linear_row_of_a_component_binds_its_coordinates():
    m = Mechanism("two")
    first, second = bar(m, "first"), bar(m, "second")
    m.connect(m.world, Prismatic("px", axis="x", actuated=True), first)
    m.connect(first, Prismatic("py", axis="y"), second)
    m.add(Line("line", "px", "py"))
    system = m.assemble()
    assert system.closure.mobility == 1
    with pytest.raises(NoClosedForm, match=r"loop of line has no .*, the rows of a Line bind it"):
        plan(system)
    assert plan_from(system, {0, 1}) == ()
    q = solve(system, {"px": 0.1})
    assert q == pytest.approx([0.1, 0.1], abs=1e-12)
