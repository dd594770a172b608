"""Motions of drive lines against closed forms, plain numpy models and balances of power."""

import casadi
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.closed_mechanisms import planar_loop
from support.messages import refused

import mbs
from mbs.components import (
    Body,
    DCMotor,
    ElasticGear,
    ElasticShaft,
    IdealGear,
    Revolute,
    ShaftDamper,
    ShaftInertia,
    TorqueSource,
)
from mbs.errors import ModelError


def run(system, duration, **options):
    return mbs.simulate.run(system, duration, quiet=True, **{"tolerance": 1e-11, **options})


def line(*connections):
    """A drive line alone."""
    m = mbs.Mechanism("line", gravity=(0, 0, 0))
    for a, b in connections:
        m.connect(a, b)
    return m.assemble()


def test_two_inertias_on_an_elastic_shaft_have_their_frequency():
    a, b, shaft = ShaftInertia("a", 0.2), ShaftInertia("b", 0.5), ElasticShaft("shaft", 300.0)
    system = line((a.flange_b, shaft.flange_a), (shaft.flange_b, b.flange_a))
    result = run(system, 1.0, q0={"a": 0.01})
    swing = 0.01 * np.cos(np.sqrt(300 * (1 / 0.2 + 1 / 0.5)) * result.time)
    np.testing.assert_allclose(result["a.q"] - result["b.q"], swing, atol=1e-9)
    np.testing.assert_allclose(0.2 * result["a.q"] + 0.5 * result["b.q"], 0.002, atol=1e-12)


R, L, K, J = 1.5, 0.02, 0.08, 4e-4
"""Of a motor with a mechanical time constant of 94 ms and an electrical one of 13 ms."""


def motor_and_load(inductance, inertia=J):
    motor = DCMotor("motor", resistance=R, inductance=inductance, constant=K, inertia=1e-4)
    load = ShaftInertia("load", inertia - 1e-4)
    return line((motor.flange, load.flange_a))


def test_run_up_without_inductance():
    result = run(motor_and_load(0), 0.5, u={"motor": 12.0})
    w = 12 / K * (1 - np.exp(-result.time * K**2 / (R * J)))
    np.testing.assert_allclose(result["load.v"], w, rtol=0, atol=1e-8)
    np.testing.assert_allclose(result["motor.i"], (12 - K * w) / R, atol=1e-8)
    np.testing.assert_allclose(result["motor.tau"], K * result["motor.i"], atol=1e-15)
    assert result.units["motor.i"] == "A"


@pytest.mark.parametrize("inductance", [L, 0.1], ids=["overdamped", "oscillating"])
def test_run_up_with_inductance(inductance):
    """Step response of L J w'' + R J w' + K^2 w = K u, in closed form by its two poles."""
    result = run(motor_and_load(inductance), 0.5, u={"motor": 12.0})
    t = result.time
    s = np.roots([inductance * J, R * J, K**2]).astype(complex)
    share = s[::-1] * [1, -1] / (s[0] - s[1])
    w = 12 / K * (1 + sum(c * np.exp(x * t) for c, x in zip(share, s, strict=True))).real
    rate = 12 / K * sum(c * x * np.exp(x * t) for c, x in zip(share, s, strict=True)).real
    assert (abs(s[0].imag) > 1) == (inductance == 0.1)
    np.testing.assert_allclose(result["load.v"], w, rtol=0, atol=1e-8)
    np.testing.assert_allclose(result["motor.i"], J / K * rate, rtol=0, atol=1e-8)
    np.testing.assert_allclose(result["load.tau"], result["motor.tau"], atol=1e-15)


def test_current_that_starts_decays():
    motor = DCMotor("motor", resistance=R, inductance=L, constant=K, inertia=1e6)
    system = line((motor.flange, ShaftInertia("load", 1e6).flange_a))
    result = run(system, 0.05, z0={"motor.i": 2.0})
    np.testing.assert_allclose(result["motor.i"], 2 * np.exp(-R / L * result.time), atol=1e-8)


def robot(gear=None, inductance=L):
    """A pendulum of 2 kg that a motor turns through an elastic gear."""
    m = mbs.Mechanism("robot", gravity=(0, 0, -9.81))
    link = m.add(Body("link", mass=2.0, com=(0.4, 0, 0), inertia=(0.01, 0.05, 0.05)))
    joint = Revolute("j", axis="y")
    motor = DCMotor("motor", resistance=R, inductance=inductance, constant=K, inertia=1e-4)
    gear = gear or ElasticGear("gear", 900.0, 1.5, ratio=60)
    m.connect(motor.flange, gear.flange_a)
    m.connect(gear.flange_b, joint.flange)
    m.connect(m.world, joint, link)
    return m


def by_hand(t, x):
    """Pendulum, rotor and current: the equations written out, x = [q, angle, v, speed, i]."""
    q, angle, v, w, i = x
    torque = 900 * (angle / 60 - q) + 1.5 * (w / 60 - v)
    voltage = 6 + 4 * np.sin(20 * t)
    return np.array(
        [
            v,
            w,
            (torque + 2 * 9.81 * 0.4 * np.cos(q)) / (0.05 + 2 * 0.4**2),
            (K * i - torque / 60) / 1e-4,
            (voltage - R * i - K * w) / L,
        ]
    )


def runge_kutta(f, x, duration, steps):
    h = duration / steps
    for n in range(steps):
        t = n * h
        a = f(t, x)
        b = f(t + h / 2, x + h / 2 * a)
        c = f(t + h / 2, x + h / 2 * b)
        x = x + h / 6 * (a + 2 * b + 2 * c + f(t + h, x + h * c))
    return x


def test_robot_joint_with_an_elastic_gear_moves_as_its_equations_say():
    system = robot().assemble()
    start = {"j": 0.2, "motor.rotor": 11.0}
    result = run(system, 0.4, q0=start, u=lambda t, q, v: 6 + 4 * casadi.sin(20 * t))
    x = runge_kutta(by_hand, np.array([0.2, 11.0, 0, 0, 0]), 0.4, 8000)
    columns = ["j.q", "motor.rotor.q", "j.v", "motor.rotor.v", "motor.i"]
    np.testing.assert_allclose([result[c][-1] for c in columns], x, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(result["motor.voltage"], 6 + 4 * np.sin(20 * result.time))
    np.testing.assert_allclose(result["motor.w"], result["motor.rotor.v"])


def test_stiff_gear_moves_as_the_rigid_one():
    rigid = run(robot(IdealGear("gear", 60), 0).assemble(), 0.3, u={"motor": 9.0})
    gear = ElasticGear("gear", 1e6, 500.0, ratio=60)
    stiff = run(robot(gear, 0).assemble(), 0.3, u={"motor": 9.0}, tolerance=1e-9)
    np.testing.assert_allclose(stiff["j.q"], rigid["j.q"], atol=3e-5)
    assert np.ptp(rigid["j.q"]) > 0.05


def test_undamped_elastic_drive_keeps_its_energy():
    m = mbs.Mechanism("swing", gravity=(0, 0, -9.81))
    joint, gear = Revolute("j", axis="y"), ElasticGear("gear", 900.0, ratio=-60)
    m.connect(m.world, joint, m.add(Body("link", mass=2, com=(0.4, 0, 0), inertia=(0, 0.05, 0.05))))
    m.connect(gear.flange_b, joint.flange)
    m.connect(gear.flange_a, ShaftInertia("rotor", 1e-4).flange_a)
    result = run(m.assemble(), 2.0, q0={"j": 0.1, "rotor": -7.0})
    total = result["kinetic_energy"] + result["potential_energy"]
    assert np.ptp(total) < 1e-7
    assert np.ptp(result["kinetic_energy"]) > 1


def test_power_of_the_motor_is_stored_or_lost():
    """Voltage times current less what resistance, gear and bearing take is the rate of energy."""
    m = robot()
    bearing = ShaftDamper("bearing", 2e-5)
    m.connect(bearing.flange, m.components["motor"].flange)
    step = 2.5e-4
    result = run(m.assemble(), 0.3, u={"motor": 8.0}, step=step)
    i, w, v = (result[name] for name in ("motor.i", "motor.w", "j.v"))
    power = 8 * i - R * i**2 - 1.5 * (w / 60 - v) ** 2 - 2e-5 * w**2
    stored = result["kinetic_energy"] + result["potential_energy"] + L / 2 * i**2
    work = step / 3 * (power[0] + power[-1] + 4 * power[1::2].sum() + 2 * power[2:-1:2].sum())
    assert stored[-1] - stored[0] == pytest.approx(work, abs=1e-7)
    assert abs(work) > 0.5


def test_loop_on_an_elastic_drive_keeps_its_energy():
    """A five-bar one joint of which hangs on an elastic gear: the rotor is outside of the loop."""
    m, configuration = planar_loop(3)
    joint = next(m.joints())
    gear = ElasticGear("gear", 400.0, ratio=10)
    m.connect(gear.flange_b, joint.flange)
    m.connect(gear.flange_a, ShaftInertia("rotor", 1e-2).flange_a)
    system = m.assemble(guess={**configuration, "rotor": 10 * configuration[joint.name]})
    result = run(system, 0.5)
    total = result["kinetic_energy"] + result["potential_energy"]
    assert system.is_closed
    assert system.closure.mobility == 3
    assert np.ptp(total) < 1e-7 * max(1, np.ptp(result["kinetic_energy"]))
    assert np.ptp(result["kinetic_energy"]) > 0.1
    assert result["closure_residual"].max() < 1e-10


def test_fmu_moves_as_the_simulation(tmp_path):
    m = robot()
    m.connect(TorqueSource("extra").flange, m.components["j"].flange)
    system = m.assemble()
    start = {"j": 0.2, "motor.rotor": 11.0}
    direct = run(system, 0.3, q0=start, z0={"motor.i": 1.0}, u={"motor": 5.0, "extra": 1.0})
    path = mbs.export.fmu(system, tmp_path / "robot.fmu")
    given = {"j.q": 0.2, "motor.rotor.q": 11.0, "motor.i": 1.0}
    given |= {"motor.voltage": 5.0, "extra.tau": 1.0}
    result = mbs.simulate.fmu(path, 0.3, start=given, step=0.01, tolerance=1e-9, quiet=True)
    for name in ("j.q", "motor.rotor.v", "motor.i", "motor.tau", "motor.w", "extra.w", "j.a"):
        np.testing.assert_allclose(result[name], direct[name], rtol=1e-5, atol=1e-5)


def test_fmu_of_a_loop_with_a_motor(tmp_path):
    m = mbs.load("four_bar")
    gear = IdealGear("gear", 30)
    m.connect(gear.flange_b, m.components["j1"].flange)
    motor = DCMotor("motor", resistance=R, inductance=L, constant=K, inertia=1e-4)
    m.connect(gear.flange_a, motor.flange)
    system = m.assemble()
    direct = run(system, 0.2, u={"motor": 5.0})
    path = mbs.export.fmu(system, tmp_path / "loop.fmu")
    start = {"motor.voltage": 5.0}
    result = mbs.simulate.fmu(path, 0.2, start=start, step=0.01, tolerance=1e-9, quiet=True)
    for name in ("j1.q", "motor.i", "motor.w"):
        np.testing.assert_allclose(result[name], direct[name], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(direct["motor.w"], 30 * direct["j1.v"], rtol=1e-12)


def test_efforts_are_added_to_what_devices_deliver():
    push = TorqueSource("push")
    system = line((push.flange, ShaftInertia("wheel", 0.5).flange_a))
    result = run(system, 0.1, tau={"wheel": 1.0}, u=lambda t, q, v: 2 - 3 * v)
    np.testing.assert_allclose(result["wheel.v"], 1 - np.exp(-6 * result.time), atol=1e-9)
    np.testing.assert_allclose(result["wheel.tau"], 1 + result["push.tau"], rtol=1e-14)


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        ({"u": {"moter": 1.0}}, ["u names 'moter'", "'motor'"]),
        ({"u": {"motor": float("nan")}}, ["u gives nan for motor.voltage", "finite"]),
        ({"u": [1.0, 2.0]}, ["u has 2 values", "the system has 1: motor.voltage"]),
        ({"u": lambda t, q: 1.0}, ["u does not take three arguments"]),
        ({"u": lambda t, q, v: [1.0, t]}, ["u has 2 values"]),
        ({"u": "volt"}, ["u is 'volt'", "finite numbers"]),
        ({"z0": {"motor.current": 1.0}}, ["z0 names 'motor.current'", "motor.i"]),
        ({"z0": [1.0, 2.0]}, ["z0 has 2 values", "motor.i"]),
        ({"tau": {"j": 1.0}}, ["'j'", "no motor", "motor.rotor"]),
    ],
)
def test_inputs_that_are_refused(options, parts):
    system = robot().assemble()
    refused(ModelError, "robot", *parts, by=lambda: run(system, 0.1, **options))


def test_an_input_by_the_name_of_its_component():
    """The only input of a component goes by its name too, in motions and equations alike."""
    system = robot().assemble()
    motion = run(system, 0.01, u={"motor": 2.0})
    np.testing.assert_array_equal(motion["motor.voltage"], 2.0)
    assert mbs.models.dae(system, inputs={"motor": 2.0}).u0[-1] == 2.0


def test_inputs_of_a_system_without_motors_are_refused():
    system = catalogue_system("planar_2r")
    refused(ModelError, "no motor", "tau", by=lambda: run(system, 0.1, u={"motor": 1.0}))
