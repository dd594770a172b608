"""Sampled blocks beside recursions in plain numbers, in run and in FMUs."""

import fmpy
import numpy as np
import pytest

import mbs
from mbs.components import (
    Box,
    Constant,
    DCMotor,
    FirstOrder,
    JointSensor,
    Revolute,
    SampledPID,
    SampleHold,
    TorqueSource,
)

PERIOD, TARGET = 0.05, 0.4


def plant(**limits):
    m = mbs.Mechanism("plant", gravity=(0, 0, 0))
    bar, joint = m.add(Box("bar", length=1.0, mass=1.0)), Revolute("j", axis="z")
    m.connect(m.world, joint, bar.left)
    source = m.add(TorqueSource("source"))
    m.connect(source.flange, joint.flange)
    m.add(JointSensor("encoder", "j"))
    pid = m.add(SampledPID("pid", PERIOD, kp=3.0, ki=0.8, kd=1.2, **limits))
    m.connect_signal("encoder.q", pid.measured)
    m.connect_signal(m.add(Constant("target", TARGET)).y, pid.target)
    m.connect_signal(pid.u, source.tau)
    return m.assemble()


def recursion(inertia, count, low=-np.inf, high=np.inf):
    """Angle at every look, and the torque after it."""
    q = v = x = before = 0.0
    rows = []
    for _ in range(count):
        error = TARGET - q
        given, more = 3.0 * error + 1.2 * (error - before) / PERIOD, x + 0.8 * error * PERIOD
        whole = given + more
        if not (
            np.clip(whole, low, high) != whole
            and (whole - np.clip(whole, low, high)) * (more - x) > 0
        ):
            x = more
        torque, before = np.clip(given + x, low, high), error
        rows.append((q, torque))
        a = torque / inertia
        q, v = q + v * PERIOD + a * PERIOD**2 / 2, v + a * PERIOD
    return np.array(rows)


@pytest.mark.parametrize("limits", [{}, {"low": -2.0, "high": 1.5}, {"high": 2.0}])
def test_a_sampled_controller_is_a_recursion(limits):
    system = plant(**limits)
    inertia = float(mbs.models.inertia_matrix(system)([0.0]))
    exact = recursion(inertia, 60, **limits)
    result = mbs.simulate.run(system, 59.5 * PERIOD, step=PERIOD / 2, quiet=True)
    np.testing.assert_allclose(result["j.q"][::2], exact[:, 0], atol=1e-9)
    np.testing.assert_allclose(result["pid.u"][1::2], exact[:, 1], atol=1e-8)


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_an_fmu_looks_at_the_same_instants(tmp_path, kind):
    system = plant(high=2.0)
    exact = recursion(float(mbs.models.inertia_matrix(system)([0.0])), 40, high=2.0)
    mbs.export.fmu(system, tmp_path / "sampled.fmu")
    found = fmpy.simulate_fmu(
        str(tmp_path / "sampled.fmu"), fmi_type=kind, stop_time=39.5 * PERIOD, output=["pid.u"],
        output_interval=PERIOD / 2, relative_tolerance=1e-10,
    )  # fmt: skip
    middle = (np.arange(40) + 0.5) * PERIOD
    rows = [int(np.argmin(np.abs(found["time"] - t))) for t in middle]
    np.testing.assert_allclose(np.asarray(found["pid.u"])[rows], exact[:, 1], atol=1e-6)


def test_sample_and_hold_keeps_what_it_saw():
    m = mbs.Mechanism("signals", gravity=(0, 0, 0))
    bar = m.add(Box("bar", length=1.0, mass=1.0))
    joint = Revolute("j", axis="z")
    m.connect(m.world, joint, bar.left)
    motor = m.add(DCMotor("motor", 1.0, 0.0, 0.1))
    m.connect(motor.flange, joint.flange)
    lag = m.add(FirstOrder("lag", time=0.5))
    hold = m.add(SampleHold("hold", 0.2))
    m.connect_signal(m.add(Constant("one", 1.0)).y, lag.u)
    m.connect_signal(lag.y, hold.u)
    result = mbs.simulate.run(m.assemble(), 0.95, step=0.05, quiet=True)
    looks = 0.2 * np.floor(result.time / 0.2 + 1e-9)
    inside = np.abs(result.time - looks) > 0.01
    exact = 1 - np.exp(-looks / 0.5)
    np.testing.assert_allclose(result["hold.y"][inside], exact[inside], atol=1e-8)
