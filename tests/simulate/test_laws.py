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
    RigidClutch,
    ShaftInertia,
    TorqueSource,
    custom,
)
from mbs.errors import Interrupted, ModelError, SolverError
from mbs.models.state.laws import conditions_of, time_laws
from mbs.native import compiler_found
from mbs.solvers import integrate, integrate_events

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
    np.testing.assert_allclose(result["i.q"], exact, atol=0.1 * tolerance)


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


def stops_of(law, end=20.0):
    """Times at which steps end for a law of time, and whether it may jump there."""
    t, nothing = casadi.SX.sym("t"), casadi.SX(0, 1)
    found = time_laws(conditions_of(casadi.SX(law(t)), t, nothing, nothing), t, nothing)
    return (np.empty(0), np.empty(0, bool)) if found is None else found.stops(0.0, end, [])


@pytest.mark.parametrize(
    "law",
    [
        lambda t: 3 - 2 * t,
        lambda t: casadi.sin(0.1 * t),
        lambda t: casadi.sin(7 * t) + t**2,
        lambda t: 5.0 + 0 * t,
    ],
)
def test_laws_without_short_changes_end_no_steps(law):
    assert len(stops_of(law)[0]) == 0


def test_a_short_law_ends_a_step_before_the_pulse_alone():
    times, jumps = stops_of(lambda t: casadi.exp(-(((t - 9.7) / 0.02) ** 2)))
    assert not jumps.any()
    assert len(times) < 5
    assert np.abs(times - 9.7).max() < 0.04


def test_jumps_are_found_exactly():
    times, jumps = stops_of(lambda t: casadi.if_else(casadi.fmod(t, 1) < 0.001, 1, 0), 3.0)
    assert jumps.all()
    np.testing.assert_allclose(times, [0.001, 1, 1.001, 2, 2.001], rtol=1e-14)
    times, _ = stops_of(lambda t: casadi.if_else(t < 5.3, 1, casadi.sign(7.1 - t)))
    assert times.tolist() == [5.3, 7.1]
    narrow, _ = stops_of(lambda t: casadi.if_else(casadi.sin(t) > 1 - 1e-12, 1, 0), 3.0)
    half = np.arccos(1 - 1e-12)
    np.testing.assert_allclose(narrow[[0, -1]], [np.pi / 2 - half, np.pi / 2 + half], atol=1e-9)
    fast, _ = stops_of(lambda t: casadi.if_else(casadi.sin(2 * np.pi * 500 * t) > 0.9, 1, 0), 4.0)
    assert len(fast) == 4000


@pytest.mark.parametrize("method", ["dopri5", "rodas"])
@pytest.mark.parametrize("compiled", [True, False])
def test_steps_end_at_stops(method, compiled):
    t, x = casadi.SX.sym("t"), casadi.SX.sym("x")
    whole = {"method": method, "compiled": compiled}
    pulse = casadi.Function("rhs", [t, x], [casadi.exp(-(((t - 2.2) / 1e-3) ** 2))])
    assert integrate(pulse, [0.0], [0.0, 10.0], **whole)[-1, 0] == pytest.approx(0.0, abs=1e-12)
    motion = integrate_events(pulse, [0.0], [0.0, 10.0], None, stops=([2.199], [False]), **whole)
    assert motion.x[-1, 0] == pytest.approx(1e-3 * np.sqrt(np.pi), rel=1e-6)
    jump = casadi.Function("rhs", [t, x], [casadi.if_else(t > 0.1 * 3, -(x**2), 1)])
    motion = integrate_events(jump, [0.0], [0.0, 0.3, 1.0], None, stops=([0.3], [True]), **whole)
    np.testing.assert_allclose(motion.x[:, 0], [0, 0.3, 0.3 / (1 + 0.3 * 0.7)], atol=1e-8)


@pytest.mark.parametrize("stops", [([1.0, 0.5], [1, 1]), ([1.0], []), ([np.nan], [True])])
def test_stops_are_increasing_times(stops):
    t, x = casadi.SX.sym("t"), casadi.SX.sym("x")
    rhs = casadi.Function("rhs", [t, x], [-x])
    with pytest.raises(ModelError, match="stops must be finite times in increasing order"):
        integrate_events(rhs, [0.0], [0.0, 10.0], None, stops=stops)


@pytest.mark.parametrize("tolerance", [1e-5, 1e-8])
@pytest.mark.parametrize("speed", [1.0, 10.0, 100.0])
@pytest.mark.parametrize("width", [0.1, 0.01, 0.001])
def test_a_smooth_potential_well_is_met_at_speed(width, speed, tolerance):
    class Well(Custom):
        flange = custom.flange()

        def energy(self, at):
            """Energy that is low near an angle."""
            return -30 * casadi.exp(-(((at.flange.angle - 5.003) / width) ** 2))

    duration = 10 / speed
    result = mbs.simulate.run(
        shaft(Well("well")), duration, v0={"i": speed}, tolerance=tolerance, quiet=True
    )
    x = np.linspace(5.003 - 8 * width, 5.003 + 8 * width, 100_001)
    inside = np.sqrt(speed**2 + 60 * np.exp(-(((x - 5.003) / width) ** 2)))
    ahead = speed * np.trapezoid(1 / speed - 1 / inside, x)
    assert result["i.q"][-1] - 10 == pytest.approx(ahead, abs=10 * tolerance)
    assert result["i.v"][-1] == pytest.approx(speed, abs=10 * tolerance)


def test_pulses_of_many_widths_in_sums_have_their_whole_effect():
    for width in (0.1, 1e-3, 1e-6):
        speed = last_speed(
            lambda t, q, v: 50 * casadi.sin(0.1 * t) + casadi.exp(-(((t - 5) / width) ** 2)),  # noqa: B023
            10.0,
        )
        exact = 500 * (1 - np.cos(1.0)) + width * np.sqrt(np.pi)
        assert speed == pytest.approx(exact, abs=1e-7)


@pytest.mark.parametrize("method", ["dopri5", "rodas"])
@pytest.mark.parametrize("compiler", [True, False])
def test_jumps_in_time_cost_no_accuracy(method, compiler, monkeypatch):
    monkeypatch.setitem(
        integrate_events.__globals__, "compiler_found", lambda: compiler and compiler_found()
    )
    speed = last_speed(
        lambda t, q, v: casadi.if_else(casadi.sin(2 * np.pi * t) > 0, 1.0, -0.9),
        5.0,
        method=method,
        tolerance=1e-5,
    )
    assert speed == pytest.approx(0.25, abs=1e-12)


def test_counts_of_states_are_crossed_one_by_one():
    """A detent torque with a jump at each tenth of a radian."""
    result = mbs.simulate.run(
        shaft(), 3.0, v0={"i": 5.0}, u=lambda t, q, v: -casadi.floor(10 * q[0]) / 10, quiet=True
    )
    finer = mbs.simulate.run(
        shaft(),
        3.0,
        v0={"i": 5.0},
        u=lambda t, q, v: -casadi.floor(10 * q[0]) / 10,
        tolerance=1e-11,
        quiet=True,
    )
    np.testing.assert_allclose(result["i.q"], finer["i.q"], atol=1e-7)


def test_a_clutch_is_engaged_by_a_short_pulse():
    """A rigid clutch slips for half a second, and brakes one shaft by its torque."""
    m = mbs.Mechanism("clutch")
    a, b = ShaftInertia("a", 1.0), ShaftInertia("b", 2.0)
    clutch = RigidClutch("c", 6.0)
    m.connect(a.flange_b, clutch.flange_a)
    m.connect(clutch.flange_b, b.flange_a)
    system = m.assemble()
    for begin, end, expected in ((10.003, 10.503, 7.0), (3.0, 3.2, 8.8)):
        result = mbs.simulate.run(
            system,
            20.0,
            v0={"a": 10.0},
            u=lambda t, q, v: between(t, begin, end),  # noqa: B023
            quiet=True,
        )
        assert result["a.v"][-1] == pytest.approx(expected, abs=1e-7)


def test_conditions_that_are_equal_for_positive_angles_are_told_apart():
    """Torques of |q| < 0.5, of q < 0.5 and of fmin(q, 5) < 0.5 beside formulas."""

    class Both(Custom):
        flange = custom.flange()

        def loads(self, at):
            """Loads of three conditions."""
            q = at.flange.angle
            near = casadi.if_else(casadi.fabs(q) < 0.5, 1.0, 0.0)
            below = casadi.if_else(q < 0.5, 2.0, 0.0)
            return {"flange": near + below + casadi.if_else(casadi.fmin(q, 5) < 0.5, 4.0, 0.0)}

    result = mbs.simulate.run(shaft(Both("both")), 2.0, q0={"i": -1.0}, quiet=True)
    # 6 N m from -1 to -0.5, 7 N m from there to 0.5, then none
    first = np.sqrt(2 * 0.5 / 6)
    middle = 6 * first
    last = np.sqrt(middle**2 + 2 * 7)
    after = 2.0 - first - (last - middle) / 7
    assert result["i.v"][-1] == pytest.approx(last, abs=1e-10)
    assert result["i.q"][-1] == pytest.approx(0.5 + last * after, abs=1e-10)


# Laws written in Python.


class PythonLaw(casadi.Callback):
    """Efforts of joints by Python code that is called at each evaluation."""

    def __init__(self, code, size=6):
        casadi.Callback.__init__(self)
        self.code, self.size = code, size
        self.construct("gains", {"enable_fd": True})

    def get_n_in(self):
        return 3

    def get_n_out(self):
        return 1

    def get_sparsity_in(self, i):
        return casadi.Sparsity.dense(1 if i == 0 else self.size, 1)

    def get_sparsity_out(self, i):
        return casadi.Sparsity.dense(self.size, 1)

    def eval(self, arguments):
        return [self.code(*arguments)]


@pytest.mark.parametrize("method", ["dopri5", "rodas"])
def test_a_short_pulse_in_python_code_has_its_whole_effect(method):
    """No condition can be read in Python code: the steps are short."""
    law = PythonLaw(lambda t, q, v: np.exp(-(((float(t) - 7.3) / 0.02) ** 2)), size=1)
    assert last_speed(law, method=method) == pytest.approx(0.02 * np.sqrt(np.pi), rel=1e-6)


@pytest.mark.parametrize("method", ["dopri5", "rodas"])
def test_the_error_of_a_law_is_the_cause_of_the_stop(method, capfd):
    def code(t, q, v):
        if float(t) > 0.05:
            raise ValueError("the table of gains has no row here")
        return -5 * v

    system = mbs.load("puma560").assemble()
    with pytest.raises(
        SolverError, match=r"the law 'gains' raised an error: the table of"
    ) as error:
        mbs.simulate.run(system, 0.2, tau=PythonLaw(code), method=method, quiet=True)
    assert "the table of gains has no row here" in str(error.value.__cause__)
    assert error.value.time <= 0.05
    assert error.value.result.time[-1] <= 0.05


def test_control_c_in_a_law_stops_the_run_at_once():
    """Rows are made when the result is read: until then the law is not called again."""
    calls = []

    def code(t, q, v):
        calls.append(float(t))
        if len(calls) == 300:
            raise KeyboardInterrupt
        return -5 * v

    system = mbs.load("puma560").assemble()
    with pytest.raises(Interrupted) as stop:
        mbs.simulate.run(system, 20.0, tau=PythonLaw(code), quiet=True)
    assert len(calls) == 300
    reached = stop.value.time
    assert 0 < reached < 20
    assert stop.value.result.time[-1] == pytest.approx(reached, abs=0.01)


# Efforts of closed systems.


def test_laws_of_closed_systems_have_the_efforts_of_their_models():
    """Two motors of a five-bar, as numbers, a law, and a Function of the independent velocities."""
    system = mbs.load("five_bar").assemble()
    names = [system.velocity_coordinates[k].name for k in system.motors]
    assert (system.nv, len(names)) == (4, 2)
    options = {"quiet": True, "step": 0.1, "q0": dict.fromkeys(names, 0.2)}
    by_name = mbs.simulate.run(
        system, 0.3, tau=dict(zip(names, (0.3, -0.2), strict=True)), **options
    )
    t, q, v = casadi.SX.sym("t"), casadi.SX.sym("q", system.nq), casadi.SX.sym("v", 2)
    for tau in (
        [0.3, -0.2],
        np.array([0.3, -0.2]),
        lambda t, q, v: casadi.vertcat(0.3, -0.2),
        casadi.Function("law", [t, q, v], [casadi.vertcat(0.3, -0.2 + 0 * v[0])]),
    ):
        result = mbs.simulate.run(system, 0.3, tau=tau, **options)
        np.testing.assert_allclose(result.values, by_name.values, rtol=0, atol=1e-9)
    damped = mbs.simulate.run(
        system, 0.3, tau=casadi.Function("law", [t, q, v], [-0.05 * v]), **options
    )
    index = [system.velocity_coordinates[k].name for k in system.independent]
    for name in index:
        np.testing.assert_allclose(damped[f"{name}.tau"], -0.05 * damped[f"{name}.v"], atol=1e-12)
    with pytest.raises(ModelError, match=r"tau has 3 values, the system has 4: .*, the models 2: "):
        mbs.simulate.run(system, 0.3, tau=lambda t, q, v: casadi.vertcat(1, 2, 3), **options)


SCALARS = [
    lambda t, q, v: 1.0,
    lambda t, q, v: casadi.sin(t),
    lambda t, q, v: casadi.DM(1),
    lambda t, q, v: np.array(0.5),
    lambda t, q, v: [1.0],
]


@pytest.mark.parametrize("law", SCALARS)
@pytest.mark.parametrize("name", ["planar_2r", "cart_pole", "five_bar"])
def test_one_effort_for_several_joints_is_refused(name, law):
    """Also if only one of the joints of an open system has a motor."""
    system = mbs.load(name).assemble()
    names = ", ".join(speed.name for speed in system.velocity_coordinates)
    message = f"{name}: tau has 1 values, the system has {system.nv}: {names}"
    for call in (
        lambda: mbs.simulate.run(system, 0.1, tau=law, quiet=True),
        lambda: mbs.simulate.Simulator(system, tau=law),
        lambda: mbs.simulate.sweep(system, {"q1.v": [0.0, 1.0]}, 0.1, tau=law),
    ):
        with pytest.raises(ModelError, match=message):
            call()


def test_one_effort_of_a_closed_system_with_one_motor_is_that_of_its_models():
    system = mbs.load("four_bar").assemble()
    options = {"quiet": True, "step": 0.1}
    named = mbs.simulate.run(system, 0.1, tau=lambda t, q, v: {"j1": casadi.sin(t)}, **options)
    for law in (lambda t, q, v: casadi.sin(t), lambda t, q, v: [casadi.sin(t)]):
        result = mbs.simulate.run(system, 0.1, tau=law, **options)
        np.testing.assert_allclose(result.values, named.values, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "matrix", [np.zeros((2, 2)), [[0, 0], [0, 0]], casadi.DM(2, 2), casadi.SX(2, 2)]
)
def test_matrices_are_no_efforts_and_no_positions(matrix):
    """Four elements of a matrix would be taken by rows from NumPy, by columns from CasADi."""
    system = mbs.load("five_bar").assemble()
    shape = r"\(2, 2\)"
    with pytest.raises(
        ModelError, match=rf"tau\(t, q, v\) returns the shape {shape}.*: q1, q2, q3"
    ):
        mbs.simulate.run(system, 0.1, tau=lambda t, q, v: matrix, quiet=True)
    if isinstance(matrix, casadi.SX):
        return
    for given in ({"tau": matrix}, {"q0": matrix}, {"v0": matrix}):
        with pytest.raises(ModelError, match=rf"five_bar: the \w+ has the shape {shape}; give a"):
            mbs.simulate.run(system, 0.1, quiet=True, **given)
    with pytest.raises(ModelError, match=f"five_bar: the effort has the shape {shape}"):
        mbs.models.linearise(system).at(tau0=matrix)


def test_a_law_that_needs_numbers_is_refused():
    system = mbs.load("planar_2r").assemble()
    for law in (lambda t, q, v: [float(q[0]), 0.0], lambda t, q, v: float(q[0]) * q):
        with pytest.raises(
            ModelError, match=r"finite numbers|float\(q\[0\]\).*make NaN of symbols"
        ):
            mbs.simulate.run(system, 0.1, tau=law, quiet=True)


def empty(*_):
    raise ValueError


ORDINARY = [
    (lambda *_: [1 / 0, 0], ZeroDivisionError, "raises ZeroDivisionError: division by zero;"),
    (lambda *_: [{}["gain"], 0], KeyError, "raises KeyError: 'gain'; correct the function"),
    (lambda *_: [[1.0][3], 0], IndexError, "raises IndexError: list index out of range;"),
    (
        lambda t, *_: [None + t, 0],
        TypeError,
        "could not be traced with CasADi symbols, it raises TypeError: unsupported operand",
    ),
    (empty, ValueError, "could not be traced with CasADi symbols, it raises ValueError; build"),
]


@pytest.mark.parametrize(("law", "kind", "text"), ORDINARY)
def test_an_error_of_python_in_a_law_keeps_its_type_and_text(law, kind, text):
    arm = mbs.robots.planar_2r().assemble()
    with pytest.raises(ModelError) as caught:
        mbs.simulate.run(arm, 0.1, tau=law)
    assert f"planar_2r: tau(t, q, v) {text}" in str(caught.value)
    assert type(caught.value.__cause__) is kind
    with pytest.raises(ModelError) as caught:
        mbs.simulate.run(arm, 0.1, motion={"q1.q": law})
    assert f"planar_2r: the motion of q1.q {text}" in str(caught.value)
    assert type(caught.value.__cause__) is kind
