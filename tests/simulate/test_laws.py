"""Laws that jump, pulse or bend, beside formulas in plain numbers."""

import casadi
import numpy as np
import pytest

import mbs
from mbs.components import (
    Body,
    Custom,
    DCMotor,
    Revolute,
    ShaftInertia,
    TorqueSource,
    custom,
)
from mbs.errors import ModelError
from mbs.solvers import integrate, integrate_events
from mbs.solvers.limits import step_limits
from mbs.solvers.problem import StepLimits

PULSES = [(round(begin, 3), 0.5) for begin in np.linspace(0.503, 19.103, 20)]


def shaft(*parts):
    """A shaft of 1 kg m^2 that a torque source turns."""
    m = mbs.Mechanism("shaft")
    inertia, torque = ShaftInertia("i", 1.0), TorqueSource("t")
    m.connect(torque.flange, inertia.flange_a)
    for part in parts:
        m.connect(inertia.flange_b, part.flange)
    return m.assemble()


def last_speed(law, duration=20.0, **more):
    return mbs.simulate.run(shaft(), duration, u=law, quiet=True, **more)["i.v"][-1]


def between(t, begin, end):
    return casadi.if_else(casadi.logic_and(t >= begin, t < end), 1.0, 0.0)


@pytest.mark.parametrize(("begin", "width"), PULSES)
def test_a_pulse_turns_a_shaft_that_rests(begin, width):
    speed = last_speed(lambda t, q, v: 2 * between(t, begin, begin + width))
    assert speed == pytest.approx(2 * width, abs=1e-8)


TIME = np.linspace(0, 20, 2_000_001)
LAWS = {
    "nested": (lambda t: casadi.if_else(t < 10.003, 0, casadi.if_else(t < 10.503, 2, 0)), 1.0),
    "pw_const": (lambda t: casadi.pw_const(t, casadi.DM([3.1, 3.2]), casadi.DM([0, 5, 0])), 0.5),
    "fmod": (lambda t: 2 * (casadi.fmod(t, 4) < 0.1), 1.0),
    "remainder": (lambda t: casadi.remainder(t, 1.3), 0.125),
    "floor": (lambda t: casadi.floor(3 * t), 590.0),
    "ceil": (lambda t: casadi.ceil(3 * t), 610.0),
    "sign": (lambda t: casadi.sign(t - 7.3), 5.4),
    "triangle": (lambda t: casadi.fmax(0, 1 - casadi.fabs(t - 9.7) / 0.01), 0.01),
    "gauss": (lambda t: casadi.exp(-(((t - 9.7) / 0.02) ** 2)), 0.02 * np.sqrt(np.pi)),
    "narrow gauss": (lambda t: casadi.exp(-(((t - 9.7) / 0.005) ** 2)), 0.005 * np.sqrt(np.pi)),
    "smooth step": (lambda t: 0.5 + 0.5 * casadi.tanh((t - 12) / 1e-4), 8.0),
}


@pytest.mark.parametrize("method", ["dopri5", "rodas"])
@pytest.mark.parametrize("name", LAWS)
def test_a_law_of_time_has_its_whole_effect(name, method):
    law, expected = LAWS[name]
    speed = last_speed(lambda t, q, v: law(t), method=method)
    assert speed == pytest.approx(expected, rel=1e-6, abs=1e-8)


@pytest.mark.parametrize("kind", ["linear", "bspline"])
def test_a_table_in_a_law_has_its_whole_effect(kind):
    table = casadi.interpolant("table", kind, [[0, 5, 5.05, 5.1, 5.15, 20]], [0, 0, 1, 1, 0, 0])
    exact = float(np.trapezoid(np.array(table(TIME)).ravel(), TIME))
    assert last_speed(lambda t, q, v: table(t)) == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("compiler", [True, False])
def test_with_and_without_a_compiler(compiler, monkeypatch):
    if not compiler:
        monkeypatch.setenv("CC", "")
        monkeypatch.setenv("PATH", "")
    assert last_speed(lambda t, q, v: LAWS["fmod"][0](t)) == pytest.approx(1.0, abs=1e-8)
    assert last_speed(lambda t, q, v: LAWS["gauss"][0](t)) == pytest.approx(
        LAWS["gauss"][1], rel=1e-6
    )


def test_a_sweep_has_the_whole_pulse():
    study = mbs.simulate.sweep(
        shaft(), {"i.v": [0.0, 1.0]}, 20.0, u=lambda t, q, v: between(t, 10.003, 10.503)
    )
    for case, result in study:
        assert result["i.v"][-1] == pytest.approx(case["i.v"] + 0.5, abs=1e-8)


def pendulum(tau, tolerance):
    m = mbs.Mechanism("pendulum")
    bob = m.add(Body("bob", mass=1.0, com=(0.4, 0, 0)))
    m.connect(m.world, Revolute("j", axis="y", actuated=True), bob)
    return mbs.simulate.run(
        m.assemble(), 8.0, q0={"j": 0.5}, tau=tau, tolerance=tolerance, quiet=True
    )


@pytest.mark.parametrize("tolerance", [1e-5, 1e-6, 1e-8])
def test_a_pendulum_feels_a_short_kick(tolerance):
    kick = pendulum(lambda t, q, v: 40 * between(t, 3.3333, 3.3403), tolerance)
    exact = pendulum(lambda t, q, v: 40 * between(t, 3.3333, 3.3403), 1e-11)
    none = pendulum(lambda t, q, v: 0 * t, 1e-11)
    assert abs(exact["j.q"][-1] - none["j.q"][-1]) > 0.1
    np.testing.assert_allclose(kick["j.q"], exact["j.q"], atol=10 * tolerance)


class Side(Custom):
    """A torque that always points to one side of a shaft's angle."""

    flange = custom.flange()

    def loads(self, at):
        """Load that changes its sign at the angle zero."""
        return {"flange": -3 * casadi.sign(at.flange.angle)}


@pytest.mark.parametrize("tolerance", [1e-5, 1e-8, 1e-10])
def test_a_custom_load_that_jumps_has_errors_near_the_tolerance(tolerance):
    result = mbs.simulate.run(
        shaft(Side("side")), 10.0, q0={"i": 0.5}, tolerance=tolerance, quiet=True
    )
    quarter = np.sqrt(2 * 0.5 / 3)
    s = np.mod(result.time, 4 * quarter)
    fall = np.where(s > 2 * quarter, 4 * quarter - s, s)
    exact = np.where(fall < quarter, 0.5 - 1.5 * fall**2, 1.5 * (2 * quarter - fall) ** 2 - 0.5)
    np.testing.assert_allclose(result["i.q"], exact, atol=20 * tolerance)


def test_a_well_that_a_condition_bounds_is_met_at_speed():
    def law(t, q, v):
        inside = casadi.fabs(q[0] - 5.003) < 0.002
        return casadi.if_else(inside, -20.0, 0.0)

    result = mbs.simulate.run(shaft(), 2.0, u=law, v0={"i": 10.0}, quiet=True)
    assert result["i.v"][-1] == pytest.approx(np.sqrt(100 - 2 * 20 * 0.004), abs=1e-8)


def test_max_step_shows_a_smooth_well():
    def law(t, q, v):
        return -20 * casadi.exp(-(((q[0] - 5.003) / 0.002) ** 2))

    lost = np.sqrt(100 - 2 * 20 * 0.002 * np.sqrt(np.pi))
    result = mbs.simulate.run(shaft(), 2.0, u=law, v0={"i": 10.0}, quiet=True, max_step=1e-4)
    assert result["i.v"][-1] == pytest.approx(lost, abs=1e-7)


@pytest.mark.parametrize("bad", [0, -1, np.inf, "fast"])
def test_a_longest_step_is_a_positive_number(bad):
    with pytest.raises(ModelError, match=r"max_step \[s\] is .*; give a finite positive number"):
        mbs.simulate.run(shaft(), 1.0, max_step=bad, quiet=True)


def test_a_law_of_a_closed_mechanism_has_its_whole_effect():
    four_bar = mbs.load("four_bar").assemble()

    def run(tau, **more):
        return mbs.simulate.run(four_bar, 1.0, tau=tau, quiet=True, **more)

    pulse = run(lambda t, q, v: {"j1": 30 * between(t, 0.4003, 0.4013)})
    fine = run(lambda t, q, v: {"j1": 30 * between(t, 0.4003, 0.4013)}, max_step=1e-4)
    none = run(None)
    assert np.abs(fine["j1.q"] - none["j1.q"]).max() > 1e-3
    np.testing.assert_allclose(pulse["j1.q"], fine["j1.q"], atol=1e-7)


def test_a_motor_and_a_prescribed_motion_feel_pulses():
    m = mbs.Mechanism("drive")
    inertia, motor = (
        ShaftInertia("i", 0.1),
        DCMotor("motor", resistance=1.0, inductance=0.01, constant=0.5),
    )
    m.connect(motor.flange, inertia.flange_a)
    system = m.assemble()
    voltage = lambda t, q, v: 10 * between(t, 3.0007, 3.0107)  # noqa: E731
    coarse = mbs.simulate.run(system, 5.0, u=voltage, quiet=True)
    fine = mbs.simulate.run(system, 5.0, u=voltage, quiet=True, max_step=1e-4)
    assert fine["i.v"].max() > 1e-2
    np.testing.assert_allclose(coarse["i.v"], fine["i.v"], atol=1e-8)
    driven = mbs.simulate.run(
        system, 5.0, motion={"i.a": lambda t: between(t, 3.0007, 3.0107)}, quiet=True
    )
    assert driven["i.v"][-1] == pytest.approx(0.01, abs=1e-9)


def test_a_law_that_switches_without_end_does_not_stop_what_the_steps_can_follow():
    result = mbs.simulate.run(
        shaft(), 2.0, u=lambda t, q, v: 0.5 - casadi.sign(v), v0={"i": 1.0}, quiet=True
    )
    assert result["i.v"][-1] == pytest.approx(0.0, abs=1e-8)
    assert result["i.q"][-1] == pytest.approx(1.0, abs=1e-6)


def test_smooth_laws_have_no_limits_and_short_ones_fine_steps_near_the_pulse_alone():
    def of(law):
        return step_limits(law, 0.0, 20.0)

    assert len(of(lambda t: 3 - 2 * t).begins) == 0
    assert len(of(lambda t: np.sin(0.1 * t)).begins) == 0
    short = of(lambda t: np.exp(-(((t - 9.7) / 0.02) ** 2)))
    near = np.abs(short.begins - 9.7) < 0.1
    assert short.lengths[near].max() < 0.1
    assert short.lengths[~near].max() > 4
    assert len(short.begins) < 30


@pytest.mark.parametrize("method", ["dopri5", "rodas"])
@pytest.mark.parametrize("compiled", [True, False])
def test_limits_hold_in_their_parts(method, compiled):
    t, x = casadi.SX.sym("t"), casadi.SX.sym("x")
    rhs = casadi.Function("rhs", [t, x], [casadi.exp(-(((t - 2.2) / 1e-3) ** 2))])
    whole = {"method": method, "compiled": compiled}
    assert integrate(rhs, [0.0], [0.0, 10.0], **whole)[-1, 0] == pytest.approx(0.0, abs=1e-12)
    limits = StepLimits(np.array([0.0, 2.19, 2.21]), np.array([9.0, 1e-3, 9.0]))
    motion = integrate_events(rhs, [0.0], [0.0, 10.0], None, limits=limits, **whole)
    assert motion.x[-1, 0] == pytest.approx(1e-3 * np.sqrt(np.pi), rel=1e-6)
