"""Wheel sets and differential drives: circles, by equations of their own."""

import casadi
import fmpy
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mbs
from mbs.components import (
    Body,
    ForceInput,
    Free,
    Planar,
    PointOnPlane,
    Prismatic,
    Revolute,
    RollingDisc,
    WheelSet,
)
from mbs.errors import DescriptionError

RADIUS, TRACK, AHEAD = 0.1, 0.5, 0.2
WHEEL, LONG, SPIN = 0.5, 0.02, 0.01
"""Mass of a wheel, and its inertias about a diameter and about the axle."""
LOAD, TURN = 2.0, 0.3
"""Mass of the body ahead of the axle, and its inertia about the vertical."""


def set_of(kind, carrier):
    """A wheel set: two discs or one component."""
    m = mbs.Mechanism("wheels", gravity=(0, 0, -9.81))
    hull = m.add(Body("hull", mass=LOAD, com=(AHEAD, 0, 0), inertia=(0.2, 0.2, TURN)))
    joints = {"planar": Planar("p", axis="z"), "free": Free("p")}
    m.connect(m.world.at(0, 0, RADIUS), joints[carrier], hull)
    for name, side in (("l", 1), ("r", -1)):
        wheel = m.add(Body(f"wheel_{name}", mass=WHEEL, inertia=(LONG, SPIN, LONG)))
        joint = Revolute(name, axis="y", actuated=True)
        m.connect(hull.at(0, side * TRACK / 2, 0), joint, wheel)
        if kind == "discs":
            m.connect(m.world, RollingDisc(f"disc_{name}", radius=RADIUS), wheel)
    if kind == "set":
        m.add(WheelSet("set", m.world, hull, "l", "r", radius=RADIUS, track=TRACK))
    if carrier == "free":
        m.connect(m.world, PointOnPlane("caster", axis="z"), hull.at(0.3, 0, -RADIUS))
    return m, hull


def motion_by_hand(drive, push, times):
    """Angles of both wheels, x, y and yaw, of speed u and yaw rate w of the middle of the axle.

    (m + 2 I / r^2) u' = m_b d w^2 + F_u and (J + ...) w' = -m_b d u w + F_w, the body of mass m_b
    being d ahead of the axle.
    """
    mass = LOAD + 2 * WHEEL + 2 * SPIN / RADIUS**2
    half = TRACK / 2
    inertia = (
        TURN + LOAD * AHEAD**2 + 2 * (LONG + WHEEL * half**2) + 2 * SPIN * (half / RADIUS) ** 2
    )

    def rate(t, y):
        *_, yaw, u, w = y
        left, right = drive(t)
        fx, fy = push(t)
        along, across = fx * np.cos(yaw) + fy * np.sin(yaw), fy * np.cos(yaw) - fx * np.sin(yaw)
        du = (LOAD * AHEAD * w**2 + (left + right) / RADIUS + along) / mass
        dw = (-LOAD * AHEAD * u * w + (right - left) * half / RADIUS + AHEAD * across) / inertia
        turns = [(u - half * w) / RADIUS, (u + half * w) / RADIUS]
        return [*turns, u * np.cos(yaw), u * np.sin(yaw), w, du, dw]

    options = {"rtol": 1e-11, "atol": 1e-12, "t_eval": times, "max_step": 0.05}
    return solve_ivp(rate, (times[0], times[-1]), np.zeros(7), **options).y


@pytest.mark.parametrize("carrier", ["planar", "free"])
@pytest.mark.parametrize("kind", ["set", "discs"])
def test_a_differential_drive_goes_in_circles(kind, carrier):
    m, _ = set_of(kind, carrier)
    result = mbs.simulate.run(m.assemble(), 7.0, tau={"l": -0.05, "r": 0.12}, step=0.1, quiet=True)
    expected = motion_by_hand(lambda t: (-0.05, 0.12), lambda t: (0, 0), result.time)
    assert expected[4, -1] > 2 * np.pi  # it passes all headings
    np.testing.assert_allclose(result["l.q"], expected[0], rtol=0, atol=1e-5)
    np.testing.assert_allclose(result["r.q"], expected[1], rtol=0, atol=1e-5)
    assert result["closure_residual"].max() < 1e-11


def example(kind):
    """The wheel set of the examples of the Modelica library, on three joints of its own."""
    m = mbs.Mechanism("example", gravity=(0, 0, -9.81))
    before, last = m.world.at(0, 0, RADIUS), Revolute("phi", axis="z", actuated=False)
    for joint in (Prismatic("x", axis="x", actuated=False), Prismatic("y", axis="y"), last):
        after = m.add(Body(f"after_{joint.name}", mass=0))
        m.connect(before, joint, after)
        before = after
    m.connect(before, m.add(Body("body", mass=LOAD, com=(AHEAD, 0, 0), inertia=(1, 1, TURN))))
    for name, side in (("l", 1), ("r", -1)):
        wheel = m.add(Body(f"wheel_{name}", mass=WHEEL, inertia=(LONG, SPIN, LONG)))
        m.connect(before.at(0, side * TRACK / 2, 0), Revolute(name, axis="y"), wheel)
        if kind == "discs":
            m.connect(m.world, RollingDisc(f"disc_{name}", radius=RADIUS), wheel)
    if kind == "set":
        m.add(WheelSet("set", m.world, before, "l", "r", radius=RADIUS, track=TRACK))
    m.add(ForceInput("f", before.at(AHEAD, 0, 0)))
    return m.assemble(active=["l", "r"])


@pytest.mark.parametrize("kind", ["set", "discs"])
def test_the_driving_wheel_set_of_modelica(kind):
    def drive(t):
        return -0.8 * np.sin(2 * np.pi * t), -0.8 * np.sin(2 * np.pi * t + np.pi / 2)

    result = mbs.simulate.run(
        example(kind),
        3.0,
        tau=lambda t, q, v: {
            "l": -0.8 * casadi.sin(2 * np.pi * t),
            "r": -0.8 * casadi.sin(2 * np.pi * t + np.pi / 2),
        },
        step=0.1,
        quiet=True,
    )
    expected = motion_by_hand(drive, lambda t: (0, 0), result.time)
    for name, row in zip(("l", "r", "x", "y", "phi"), expected, strict=False):
        np.testing.assert_allclose(result[f"{name}.q"], row, rtol=0, atol=1e-5)


@pytest.mark.parametrize("kind", ["set", "discs"])
def test_the_pulled_wheel_set_of_modelica_turns_back(kind):
    """A force in axes of the world turns the set by more than a right angle."""
    system = example(kind)
    result = mbs.simulate.run(system, 4.0, u={"f.x": -3.0, "f.y": 4.0}, step=0.1, quiet=True)
    expected = motion_by_hand(lambda t: (0, 0), lambda t: (-3.0, 4.0), result.time)
    assert expected[4].max() > 1.7
    for name, row in zip(("l", "r", "x", "y", "phi"), expected, strict=False):
        np.testing.assert_allclose(result[f"{name}.q"], row, rtol=0, atol=1e-5)


def test_forces_of_the_ground_hold_a_circle():
    """At constant speeds on a circle: the lateral force is the centripetal one."""
    m, _ = set_of("set", "free")
    system = m.assemble()
    result = mbs.simulate.run(system, 1e-3, v0={"l": 8.0, "r": 12.0}, step=1e-3, quiet=True)
    u, w = RADIUS * 10, RADIUS * 4 / TRACK
    expected = motion_by_hand(lambda t: (0, 0), lambda t: (0, 0), np.array([0.0, 1e-3]))
    assert expected[:, -1] == pytest.approx(0)
    half = TRACK / 2
    inertia = (
        TURN + LOAD * AHEAD**2 + 2 * (LONG + WHEEL * half**2) + 2 * SPIN * (half / RADIUS) ** 2
    )
    dw = -LOAD * AHEAD * u * w / inertia
    lateral = (LOAD + 2 * WHEEL) * u * w + LOAD * AHEAD * dw
    assert result["set.force_lateral"][0] == pytest.approx(lateral, rel=1e-9)
    mass = LOAD + 2 * WHEEL + 2 * SPIN / RADIUS**2
    du = LOAD * AHEAD * w**2 / mass
    left = -SPIN * (du - half * dw) / RADIUS**2  # what turns the wheel
    assert result["set.force_left"][0] == pytest.approx(left, rel=1e-9)


def test_a_wheel_set_may_pitch_and_keeps_its_energy():
    """A body that hangs on the axle and swings while the set turns."""
    m = mbs.Mechanism("balance", gravity=(0, 0, -9.81))
    hull = m.add(Body("hull", mass=LOAD, com=(0, 0, -0.05), inertia=(0.2, 0.2, TURN)))
    m.connect(m.world.at(0, 0, RADIUS), Free("p"), hull)
    for name, side in (("l", 1), ("r", -1)):
        wheel = m.add(Body(f"wheel_{name}", mass=WHEEL, inertia=(LONG, SPIN, LONG)))
        m.connect(hull.at(0, side * TRACK / 2, 0), Revolute(name, axis="y"), wheel)
    m.add(WheelSet("set", m.world, hull, "l", "r", radius=RADIUS, track=TRACK))
    system = m.assemble()
    assert len(system.independent) == 3
    assert not system.closure.varies
    v0 = {"p.wy": 1.5, "l": -3.0, "r": 5.0}
    result = mbs.simulate.run(system, 5.0, v0=v0, tolerance=1e-9, quiet=True)
    energy = result["kinetic_energy"] + result["potential_energy"]
    assert np.ptp(energy) < 1e-6 * result["kinetic_energy"].max()
    assert np.abs(result["p.qz.q"]).max() > 0.9  # the heading has passed a right angle


def test_an_fmu_goes_in_circles(tmp_path):
    m, _ = set_of("set", "planar")
    file = mbs.export.fmu(m.assemble(), tmp_path / "drive.fmu")
    expected = motion_by_hand(lambda t: (-0.05, 0.12), lambda t: (0, 0), np.array([0.0, 5.0]))
    for kind in ("CoSimulation", "ModelExchange"):
        found = fmpy.simulate_fmu(
            str(file),
            stop_time=5.0,
            fmi_type=kind,
            start_values={"l.tau": -0.05, "r.tau": 0.12},
            output=["l.q", "r.q"],
            output_interval=0.05,
        )
        assert found["l.q"][-1] == pytest.approx(expected[0, -1], abs=1e-4)
        assert found["r.q"][-1] == pytest.approx(expected[1, -1], abs=1e-4)


def test_sizes_are_checked():
    m, hull = set_of("set", "free")
    with pytest.raises(DescriptionError, match="track is 0 m"):
        WheelSet("s", m.world, hull, "l", "r", radius=0.1, track=0)
