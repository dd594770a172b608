"""Signal blocks: each beside the solution of its equations."""

import casadi
import numpy as np
import pytest
from support.messages import refused

import mbs
from mbs.components import (
    PI,
    PID,
    Box,
    Constant,
    DCMotor,
    FirstOrder,
    Gain,
    Integrator,
    JointSensor,
    Limiter,
    RateLimiter,
    Revolute,
    SecondOrder,
    ShaftInertia,
    Sum,
    TorqueSource,
)
from mbs.errors import AssemblyError, DescriptionError
from mbs.recursions.part_checks import check_part
from mbs.recursions.parts import PartsAt


def wired(*blocks, wires=()):
    """A wheel that nothing drives, and blocks beside it."""
    m = mbs.Mechanism("blocks")
    m.connect(m.world, Revolute("j", actuated=False), m.add(Box("b", length=1.0, mass=1.0)))
    for block in blocks:
        m.add(block)
    for source, target in wires:
        m.connect_signal(source, target)
    return m


def outputs(system, u):
    """Outputs by name at inputs by name."""
    at = PartsAt(system, casadi.SX.sym("q", system.nq), casadi.SX.sym("v", system.nv))
    find = casadi.Function(
        "find", [system.component_states, system.u, system.p], [at.outputs(), at.rates()]
    )
    y, _ = find(system.component_start, [u.get(name, 0.0) for name, _ in system.inputs], 1.0)
    return dict(zip([name for name, _ in system.outputs], np.array(y)[:, 0], strict=True))


class TestWithoutMemory:
    def test_gain_sum_and_constant(self):
        bias, gain = Constant("bias", 0.25), Gain("gain", -3.0)
        total = Sum("total", weights=(2.0, 1.0, -1.0))
        m = wired(bias, gain, total, wires=[(bias.y, total.u1), (gain.y, total.u3)])
        y = outputs(m.assemble(), {"gain.u": 2.0, "total.u2": 10.0})
        assert y == {"bias.y": 0.25, "gain.y": -6.0, "total.y": 2 * 0.25 + 10 + 6}

    def test_sum_has_as_many_inputs_as_weights(self):
        m = wired(Sum("one", weights=("K",)), Sum("two"))
        m.values["K"] = mbs.Parameter("K", 4.0)
        system = m.assemble()
        assert [name for name, _ in system.inputs] == ["one.u1", "two.u1", "two.u2"]
        assert [p.name for p in system.parameters] == ["K"]
        refused(
            AssemblyError,
            "two.u3, which is no input",
            "u1, u2",
            by=wired(one := Sum("one"), wires=[(one.y, Sum("two").u3)]).assemble,
        )

    def test_limiter(self):
        system = wired(
            Limiter("both", low=-1.0, high=2.0), Limiter("top", high=3.0), Limiter("floor", low=0)
        ).assemble()
        for u in (-5.0, -1.0, 0.5, 2.0, 7.0):
            y = outputs(system, {"both.u": u, "top.u": u, "floor.u": u})
            assert y == {"both.y": min(max(u, -1), 2), "top.y": min(u, 3), "floor.y": max(u, 0)}

    def test_rounded_limiter(self):
        m = wired(Limiter("soft", low=-1.0, high=2.0, width=0.05))
        system = m.assemble()
        y = {u: outputs(system, {"soft.u": u})["soft.y"] for u in (-900, -1, 0.5, 2, 900)}
        # by w log 2 at a corner; w exp(-30) / w at thirty widths from it is rounding
        assert abs(y[2] - (2 - 0.05 * np.log(2))) < 1e-15
        assert abs(y[-1] - (-1 + 0.05 * np.log(2))) < 1e-15
        assert abs(y[0.5] - 0.5) < 1e-13
        assert y[900] == pytest.approx(2, abs=1e-13)
        assert y[-900] == pytest.approx(-1, abs=1e-13)

    def test_symbol_of_no_width_is_a_sharp_corner(self):
        m = wired(Limiter("soft", low=-1.0, high=2.0, width="W"))
        m.values["W"] = mbs.Parameter("W", 0.0)
        system = m.assemble()
        at = PartsAt(system, casadi.SX.sym("q", 1), casadi.SX.sym("v", 1))
        find = casadi.Function("find", [system.u, system.p], [at.outputs()])
        slope = casadi.Function(
            "slope", [system.u, system.p], [casadi.jacobian(at.outputs(), system.u)]
        )
        assert [float(find(u, 0.0)) for u in (-3.0, -1.0, 0.5, 2.0, 4.0)] == [-1, -1, 0.5, 2, 2]
        assert [float(slope(u, 0.0)) for u in (-3.0, 0.5, 4.0)] == [0, 1, 0]


class TestFilters:
    def test_steps_in_closed_form(self):
        m = wired(
            Integrator("sum", k=3.0, x=0.5),
            FirstOrder("lag", time=0.2, k=2.0),
            SecondOrder("two", w=8.0, damping=0.25, k=1.5),
        )
        u = {"sum": 2.0, "lag": 1.0, "two": 1.0}
        result = mbs.simulate.run(m.assemble(), 1.0, u=u, tolerance=1e-10)
        t = result.time
        # 1e-8: a hundred times the tolerance of the run
        assert np.abs(result["sum.y"] - (0.5 + 6 * t)).max() < 1e-8
        assert np.abs(result["lag.y"] - 2 * (1 - np.exp(-t / 0.2))).max() < 1e-8
        wd = 8 * np.sqrt(1 - 0.25**2)
        swing = np.cos(wd * t) + 0.25 * 8 / wd * np.sin(wd * t)
        assert np.abs(result["two.y"] - 1.5 * (1 - np.exp(-2 * t) * swing)).max() < 1e-8

    def test_rate_limiter(self):
        m = wired(RateLimiter("up", rising=2.0, time=0.05), RateLimiter("down", 2.0, 0.05, 0.5))
        result = mbs.simulate.run(m.assemble(), 1.0, u={"up": 1.0, "down": -1.0}, tolerance=1e-10)
        # at its rate until 2 * 0.05 are left, then as a first-order filter
        t, start = result.time, (1 - 2 * 0.05) / 2
        up = np.where(t < start, 2 * t, 1 - 2 * 0.05 * np.exp(-(t - start) / 0.05))
        assert np.abs(result["up.y"] - up).max() < 1e-8
        start = (1 - 0.5 * 0.05) / 0.5
        assert start > 1
        assert np.abs(result["down.y"] + 0.5 * t).max() < 1e-8


class TestControllers:
    def test_pi_on_a_first_order_plant(self):
        # kp = 3, ki = 3 / 0.2 cancels the pole of the plant 2 / (0.2 s + 1): y is a lag of 1 / 30 s
        plant, pi = FirstOrder("plant", time=0.2, k=2.0), PI("pi", kp=3.0, ki=15.0)
        m = wired(plant, pi, wires=[(pi.u, plant.u), (plant.y, pi.measured)])
        result = mbs.simulate.run(m.assemble(), 0.3, u={"pi.target": 1.0}, tolerance=1e-11)
        assert np.abs(result["plant.y"] - (1 - np.exp(-30 * result.time))).max() < 1e-9

    def test_pid_on_a_shaft(self):
        # J x'' = u; poles of the closed loop against roots of the characteristic polynomial
        m = mbs.Mechanism("shaft")
        drive, wheel = TorqueSource("drive"), ShaftInertia("wheel", 0.02)
        m.connect(drive.flange, wheel.flange_a)
        m.add(JointSensor("enc", "wheel"))
        pid = PID("pid", kp=4.0, ki=6.0, kd=0.3, filter=0.01)
        m.connect_signal("enc.q", pid.measured)
        m.connect_signal(pid.u, drive.tau)
        system = m.assemble()
        dae = mbs.models.dae(system)
        A = casadi.Function("A", [dae.x, dae.u, dae.p], [casadi.jacobian(dae.ode, dae.x)])
        poles = np.sort_complex(np.linalg.eigvals(np.array(A(dae.x0, dae.u0, dae.p0))))
        # J s^3 (Tf s + 1) + (kp s + ki)(Tf s + 1) + kd s^2 = 0
        J, T, kp, ki, kd = 0.02, 0.01, 4.0, 6.0, 0.3
        roots = np.roots([J * T, J, kp * T + kd, kp + ki * T, ki])
        assert np.abs(poles - np.sort_complex(roots)).max() < 1e-9 * np.abs(roots).max()

    def test_anti_windup(self):
        def overshoot(**limits):
            plant = Integrator("plant")
            pi = PI("pi", kp=2.0, ki=1.0, **limits)
            m = wired(plant, pi, wires=[(pi.u, plant.u), (plant.y, pi.measured)])
            result = mbs.simulate.run(m.assemble(), 20.0, u={"pi.target": 5.0}, step=0.05)
            assert abs(result["plant.y"][-1] - 5) < 1e-3
            assert result["pi.u"].max() <= 1.0
            return result["plant.y"].max() / 5 - 1

        # without tracking in effect (a time constant of an hour) the integral part winds up
        assert overshoot(low=-1.0, high=1.0, tracking=3600.0) > 0.3
        assert overshoot(low=-1.0, high=1.0) < 0.1

    def test_tracking_at_a_limit(self):
        # with e held at 5: x' = ki e + (1 - (kp e + x)) / T, to its end ki e T + 1 - kp e
        m = wired(PI("pi", kp=2.0, ki=1.0, high=1.0, tracking=0.5))
        result = mbs.simulate.run(m.assemble(), 1.0, u={"pi.target": 5.0}, tolerance=1e-10)
        end = 1.0 * 5 * 0.5 + 1 - 10
        assert np.abs(result["pi.x"] - end * (1 - np.exp(-result.time / 0.5))).max() < 1e-8
        assert np.all(result["pi.u"] == 1.0)

    def test_current_of_a_motor_is_controlled_by_its_state(self):
        m = mbs.Mechanism("current")
        motor = DCMotor("motor", resistance=1.0, inductance=0.01, constant=0.1, inertia=1e-3)
        m.add(motor)
        m.connect(motor.flange, ShaftInertia("load", 1e-2).flange_a)
        pi = PI("pi", kp=5.0, ki=500.0)
        m.connect_signal("motor.i", pi.measured)
        m.connect_signal(pi.u, motor.voltage)
        result = mbs.simulate.run(m.assemble(), 0.2, u={"pi.target": 3.0})
        # a ramp of the back voltage, K dw/dt = 0.1 * 0.3 / 0.011 V/s, leaves ramp / ki
        assert abs(result["motor.i"][-1] - (3 - 0.1 * 0.3 / 0.011 / 500)) < 1e-3


@pytest.mark.parametrize(
    ("part", "parts"),
    [
        (lambda: Limiter("l"), ["l", "neither low nor high"]),
        (lambda: Limiter("l", low=2.0, high=1.0), ["l", "low is 2 and high is 1", "order"]),
        (lambda: Limiter("l", low=2.0, width=-1.0), ["l", "width is -1", "-1"]),
        (lambda: FirstOrder("f", time=0.0), ["f", "time is 0 s"]),
        (lambda: SecondOrder("f", w=-1.0), ["f", "w is -1 rad/s"]),
        (lambda: RateLimiter("r", 0.0, 0.1), ["r", "rising is 0 1/s"]),
        (lambda: RateLimiter("r", 1.0, 0.1, -1.0), ["r", "falling is -1"]),
        (lambda: Sum("s", weights=()), ["s", "weights are ()", "one to four"]),
        (lambda: Sum("s", weights=(1, 2, 3, 4, 5)), ["s", "one to four"]),
        (lambda: Sum("s", weights=3.0), ["s", "weights are 3.0"]),
        (lambda: PI("c", 1.0, 1.0, low=1.0, high=0.0), ["c", "low is 1", "order"]),
        (lambda: PI("c", 1.0, 1.0, tracking=0.1), ["c", "tracking is 0.1", "no limits"]),
        (lambda: PI("c", 1.0, 0.0, high=1.0), ["c", "ki is 0", "give tracking"]),
        (lambda: PID("c", 0.0, 1.0, 1.0, 0.01, low=-1), ["c", "kp is 0", "give tracking"]),
        (lambda: PID("c", 1.0, 1.0, 1.0, 0.0), ["c", "filter is 0 s"]),
    ],
)
def test_descriptions_that_are_refused(part, parts):
    refused(DescriptionError, *parts, by=part)


def test_a_ring_of_blocks_without_memory_is_refused():
    one, two = Gain("one", 2.0), Gain("two", 3.0)
    m = wired(one, two, wires=[(one.y, two.u), (two.y, one.u)])
    refused(AssemblyError, "ring", "one.y", "two.y", by=m.assemble)


def test_blocks_answer_the_questions_that_are_asked_of_others():
    blocks = [
        Constant("a", 1.0),
        Gain("k", 2.0),
        Sum("c"),
        Limiter("d", low=0.0, width=0.1),
        Integrator("e"),
        FirstOrder("f", 0.1),
        SecondOrder("g", 3.0),
        RateLimiter("h", 1.0, 0.1),
        PI("i", 1.0, 1.0, low=0.0),
        PID("l", 1.0, 1.0, 1.0, 0.1, high=1.0),
    ]
    system = wired(*blocks).assemble()
    at = PartsAt(system, casadi.SX.sym("q", system.nq), casadi.SX.sym("v", system.nv))
    for part in system.parts:
        check_part(system, part, at)
    assert len(system.parts) == len(blocks)
