"""Simulation of open and closed systems against closed forms and conservation laws."""

import math

import casadi
import numpy as np
import pytest
from support.dae_mechanisms import rssr

import mbs
from mbs import Mechanism
from mbs.components import (
    Body,
    Box,
    Free,
    PointMass,
    Prismatic,
    Revolute,
)
from mbs.errors import LoopError, ModelError, Unclosable

LOOSE = casadi.SX.sym("loose")


def pendulum(**joint):
    m = Mechanism("pendulum", gravity=(0, -9.81, 0), parameters={"L": 0.7})
    bob = m.add(PointMass("bob", mass=1.3))
    rod = m.add(Body("rod", mass=0))
    m.connect(m.world, Revolute("j", **joint), rod)
    m.connect(rod.at("L"), bob)
    return m.assemble()


def test_small_oscillation_has_the_period_of_the_pendulum():
    amplitude = 1e-3
    period = 2 * np.pi * np.sqrt(0.7 / 9.81)
    result = mbs.simulate.run(
        pendulum(), period, q0={"j": -np.pi / 2 + amplitude}, step=period / 100, tolerance=1e-12
    )
    swing = result["j.q"] + np.pi / 2
    expected = amplitude * np.cos(2 * np.pi * result.time / period)
    np.testing.assert_allclose(swing, expected, atol=1e-3 * amplitude)


def test_energy_of_a_large_swing_is_kept():
    result = mbs.simulate.run(pendulum(), 10.0, q0={"j": 0.5}, tolerance=1e-11)
    total = result["kinetic_energy"] + result["potential_energy"]
    assert np.ptp(total) < 1e-8
    assert result["kinetic_energy"].max() > 5


def test_viscous_friction_takes_its_power():
    result = mbs.simulate.run(pendulum(Fv=0.2), 5.0, step=1e-3, tolerance=1e-10)
    total = result["kinetic_energy"] + result["potential_energy"]
    lost = np.trapezoid(0.2 * result["j.v"] ** 2, result.time)
    assert total[-1] - total[0] == pytest.approx(-lost, rel=1e-5)


def test_constant_effort_and_functions_of_time_and_state():
    system = pendulum()
    held = 1.3 * 9.81 * 0.7
    still = mbs.simulate.run(system, 1.0, tau={"j": held}, tolerance=1e-11)
    assert np.abs(still["j.q"]).max() < 1e-8
    servo = mbs.simulate.run(
        system, 3.0, tau=lambda t, q, v: held * casadi.cos(q) - 40 * (q - 0.3) - 12 * v
    )
    assert servo["j.q"][-1] == pytest.approx(0.3, abs=1e-3)
    t, q, v = (casadi.SX.sym(name) for name in "tqv")
    same = casadi.Function("f", [t, q, v], [held * casadi.cos(q) - 40 * (q - 0.3) - 12 * v])
    again = mbs.simulate.run(system, 3.0, tau=same)
    np.testing.assert_allclose(again["j.q"], servo["j.q"], atol=1e-12)
    expected = held * np.cos(servo["j.q"]) - 40 * (servo["j.q"] - 0.3) - 12 * servo["j.v"]
    np.testing.assert_allclose(servo["j.tau"], expected, atol=1e-12)


def test_parameters_change_the_motion():
    short = mbs.simulate.run(pendulum(), 0.5, parameters={"L": 0.35})
    long = mbs.simulate.run(pendulum(), 0.5)
    assert short["j.q"][-1] < long["j.q"][-1] - 0.1


def test_free_body_falls_and_keeps_its_angular_momentum():
    m = Mechanism("top", gravity=(0, 0, -9.81))
    m.connect(m.world, Free("f"), m.add(Body("b", mass=2, inertia=(1, 2, 2.5))))
    system = m.assemble()
    start = {"f.vz": 3.0, "f.wx": 0.1, "f.wy": 4.0, "f.wz": 0.2}
    result = mbs.simulate.run(system, 2.0, v0=start, tolerance=1e-11)
    height = 3.0 * result.time - 9.81 * result.time**2 / 2
    np.testing.assert_allclose(result["f.z.q"], height, atol=1e-8)
    norm = sum(result[f"f.q{k}.q"] ** 2 for k in "wxyz")
    np.testing.assert_allclose(norm, 1, atol=1e-12)
    T = mbs.models.transform(system, "b")
    for row in result.values[::50]:
        R = np.array(T(row[:7]))[:3, :3]
        k = dict(zip(result.units, row, strict=True))
        momentum = R @ (np.array([1, 2, 2.5]) * [k["f.wx.v"], k["f.wy.v"], k["f.wz.v"]])
        np.testing.assert_allclose(momentum, [0.1, 8.0, 0.5], atol=1e-7)


def test_four_bar_for_a_long_time_without_drift():
    system = mbs.load("four_bar").assemble()
    result = mbs.simulate.run(system, 100.0, q0={"j1": 0.3}, step=0.05, tolerance=1e-10)
    total = result["kinetic_energy"] + result["potential_energy"]
    assert result["closure_residual"].max() < 1e-12
    assert np.ptp(total) < 1e-5 * result["kinetic_energy"].max()


def test_loop_runs_through_a_configuration_where_its_crank_turns_back():
    """A double rocker: its driven joint is no coordinate where it reverses."""
    m = Mechanism("double_rocker", gravity=(0, -9.81, 0))
    a, b, c = (
        m.add(Box(n, length=x, width=0.03, mass=1)) for n, x in (("a", 0.6), ("b", 0.3), ("c", 0.7))
    )
    m.connect(m.world, Revolute("j1", actuated=True), a.left)
    m.connect(a.right, Revolute("j2"), b.left)
    m.connect(b.right, Revolute("j3"), c.right)
    m.connect(m.world.at(0.8), Revolute("j4"), c.left)
    system = m.assemble(guess={"j1": 1.2, "j2": -1.0})
    result = mbs.simulate.run(system, 5.0, tolerance=1e-11)
    assert np.any(np.diff(np.sign(result["j1.v"])) != 0)
    total = result["kinetic_energy"] + result["potential_energy"]
    assert np.ptp(total) < 1e-7
    assert result["closure_residual"].max() < 1e-12


def test_spatial_loop_with_quaternion_joints():
    result = mbs.simulate.run(rssr(), 3.0, v0={"j1": 1.0}, tolerance=1e-10)
    total = result["kinetic_energy"] + result["potential_energy"]
    assert np.ptp(total) < 1e-7
    assert result["closure_residual"].max() < 1e-12


def test_massless_link_in_a_loop_gives_numbers():
    m = Mechanism("massless", gravity=(0, -9.81, 0))
    a, b = m.add(Box("a", length=0.4, width=0.03, mass=1)), m.add(Body("rod", mass=0))
    s = m.add(Body("slider", mass=1))
    m.connect(m.world, Revolute("j1", actuated=True), a.left)
    m.connect(a.right, Revolute("j2"), b)
    m.connect(b.at(0.9), Revolute("j3"), s)
    m.connect(m.world, Prismatic("s", axis="x"), s)
    system = m.assemble(guess={"s": 1.2, "j1": 0.4})
    result = mbs.simulate.run(system, 2.0, q0={"j1": 0.4}, tolerance=1e-11)
    total = result["kinetic_energy"] + result["potential_energy"]
    assert np.ptp(total) < 1e-8
    assert np.all(np.isfinite(result.values))


def test_without_a_compiler_the_same_numbers(monkeypatch):
    system = mbs.load("four_bar").assemble()
    compiled = mbs.simulate.run(system, 0.5, tolerance=1e-9)
    monkeypatch.setitem(mbs.solvers.integrate.__globals__, "compiler_found", lambda: False)
    fresh = mbs.load("four_bar").assemble()
    python = mbs.simulate.run(fresh, 0.5, tolerance=1e-9)
    np.testing.assert_allclose(python.values, compiled.values, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (dict(q0={"jj": 1.0}), "there is no coordinate 'jj'; did you mean 'j'?"),
        (dict(v0=[1.0, 2.0]), "the velocity has 2 values, the system has 1: j"),
        (dict(parameters={"LL": 1.0}), "there is no parameter 'LL'; did you mean 'L'?"),
        (dict(tau=lambda t, q, v: [q, q]), "tau has 2 values, the system has 1: j"),
        (dict(tau=lambda t, q, v: np.sin(q.full())), "build it from CasADi operations"),
        (dict(step=0.0), "step [s] is 0.0; give a finite positive number"),
        (dict(step=1e-12), "1 s in steps of 1e-12 s are more than 10000000 rows"),
        (dict(step=1e-320), "give a longer step"),
        (dict(step=None), "step [s] is None; give"),
        (dict(duration="1"), "duration [s] is '1'; give"),
        (dict(duration=np.inf), "duration [s] is inf; give"),
        (dict(duration=True), "duration [s] is True; give"),
        (dict(tolerance=np.nan), "tolerance is nan; give"),
        (dict(tolerance=-1), "tolerance is -1; give"),
        (dict(tau=[1.0, 2.0]), "the effort has 2 values, the system has 1: j"),
        (dict(tau={"jj": 1.0}), "there is no coordinate 'jj'; did you mean 'j'?"),
        (dict(tau={"j": np.nan}), "the effort of j is nan; give a finite number"),
        (dict(tau="abc"), "the effort is 'abc'"),
        (dict(tau=lambda t, q: q), "tau does not take three arguments; give a function of"),
        (dict(tau=lambda t, q, v: None), "tau(t, q, v) returns None; return 1 efforts"),
        (dict(tau=lambda t, q, v: "1"), "tau(t, q, v) returns '1'; return 1 efforts"),
        (dict(tau=lambda t, q, v: np.nan), "tau(t, q, v) returns nan; return 1 efforts"),
        (dict(tau=lambda t, q, v: math.sin(t)), "such as math.sin make NaN of symbols; build it"),
        (dict(tau=lambda t, q, v: [LOOSE]), "tau(t, q, v) holds the symbols loose"),
        (dict(tau=lambda t, q, v: casadi.sin("x")), ": an operation of CasADi was given what it"),
        (
            dict(tau=casadi.Function("f", [LOOSE], [LOOSE])),
            "tau has inputs of sizes [1] and 1 outputs; give a Function of (t, q, v)",
        ),
    ],
)
def test_bad_arguments(arguments, message):
    with pytest.raises(ModelError) as error:
        mbs.simulate.run(pendulum(), **{"duration": 1.0, **arguments})
    text = str(error.value)
    assert message in text
    assert text.startswith("pendulum: ")
    assert "\n" not in text
    assert len(text) < 400


def test_a_joint_without_motor_is_driven_by_name_alone():
    system = pendulum(actuated=False)
    with pytest.raises(ModelError, match="tau names 'j', which has no motor"):
        mbs.simulate.run(system, 1.0, tau={"j": 1.0})
    for law in (lambda t, q, v: np.array([2.0]), lambda t, q, v: -v):
        with pytest.raises(ModelError, match="tau drives 'j', which has no motor; make that"):
            mbs.simulate.run(system, 1.0, tau=law)
    with pytest.raises(ModelError, match="tau drives 'j', which has no motor"):
        mbs.simulate.run(system, 1.0, tau=[2.0])
    result = mbs.simulate.run(system, 0.1, tau=lambda t, q, v: {"j": 2.0})
    assert np.array_equal(result["j.tau"], np.full(11, 2.0))
    result = mbs.simulate.run(system, 0.1, tau=lambda t, q, v: [0])
    assert not result["j.tau"].any()
    with pytest.raises(ModelError, match="names 'k'; "):
        mbs.simulate.run(system, 0.1, tau=lambda t, q, v: {"k": 2.0})


@pytest.mark.parametrize("wrong", [None, "four_bar", Mechanism("m")])
def test_only_systems_move(wrong):
    with pytest.raises(ModelError, match="is not a System"):
        mbs.simulate.run(wrong, 1.0)


def test_configuration_that_does_not_close():
    system = mbs.load("four_bar").assemble()
    with pytest.raises(LoopError, match=r"leaves the loops open by .*; use mbs.loops.solve"):
        mbs.simulate.run(system, 1.0, q0=[0.0, 0.0, 0.0])
    with pytest.raises(Unclosable, match=r"with j1 = 0 the loops do not close with j2 = 3"):
        mbs.loops.solve(system, {"j1": 0.0, "j2": 3.0})


def test_velocities_of_dependent_joints_are_solved_for():
    system = mbs.load("four_bar").assemble()
    result = mbs.simulate.run(system, 0.1, v0={"j4": 0.3})
    assert result["j4.v"][0] == pytest.approx(0.3, abs=1e-12)
    J = np.array(mbs.loops.closure_jacobian(system)(list(result.values[0, :3])))
    v = [result[f"{speed.name}.v"][0] for speed in system.velocity_coordinates]
    np.testing.assert_allclose(J @ v, 0, atol=1e-12)
    with pytest.raises(ModelError, match=r"allow no motion with the velocities j1 = 1, j4 = 0.3"):
        mbs.simulate.run(system, 0.1, v0={"j4": 0.3, "j1": 1.0})
