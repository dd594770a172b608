"""Forces, torques and efforts as inputs: their power, what they move, in runs, dae and FMUs."""

import casadi
import numpy as np
import pytest
from support.messages import refused
from support.parts import asked, metered, run, stored

import mbs
from mbs.components import (
    Box,
    Fixed,
    ForceInput,
    ForceSource,
    JointEffort,
    LineForceInput,
    PairForceInput,
    PairTorqueInput,
    PointMass,
    Prismatic,
    Revolute,
    ShaftInertia,
    ShaftTorqueInput,
    SlidingMass,
    Spherical,
    SpringDamperSeries,
    TorqueInput,
)
from mbs.errors import DescriptionError

GROUND = (0.1, 0.2, 0.3)


def arm(*elements):
    """A bar on a ball, and one on a hinge at its end."""
    m = mbs.Mechanism("arm", gravity=(0, 0, -9.81))
    upper, lower = (m.add(Box(name, length=0.8, mass=2.0)) for name in ("upper", "lower"))
    m.connect(m.world, Spherical("ball"), upper.left)
    m.connect(upper.right, Revolute("hinge", axis="y"), lower.left)
    m.add_frame("tip", lower.right)
    m.add_frame("middle", upper.center)
    for element in elements:
        m.add(element(m, upper, lower))
    return asked(m)


STATE = (
    np.array([0.8, 0.2, -0.4, 0.4, 0.7]),
    np.array([0.3, -0.8, 0.5, 1.1]),
    np.array([0.4, 0.1, -0.9, 0.6]),
)
"""Positions, with a quaternion of unit length, velocities and accelerations."""
GIVEN = np.array([3.0, -5.0, 7.0])


def efforts_of(*elements):
    """What elements with the input GIVEN take off the efforts."""
    system = arm(*elements)
    idm = mbs.models.inverse_dynamics(system)
    with_input, without = (idm(*STATE, u) for u in (GIVEN, 0 * GIVEN))
    return np.array(without - with_input).ravel()


def at_frame(name):
    """Jacobian and orientation of a named frame in the world."""
    system = arm()
    J = np.array(mbs.models.jacobian(system, name)(STATE[0]))
    T = np.array(mbs.models.transform(system, name)(STATE[0]))
    return J, T[:3, :3], T[:3, 3]


def test_a_force_in_the_axes_of_the_world_and_of_the_body():
    J, R, _ = at_frame("tip")
    world = efforts_of(lambda m, upper, lower: ForceInput("f", lower.right))
    body = efforts_of(lambda m, upper, lower: ForceInput("f", lower.right, axes="body"))
    np.testing.assert_allclose(world, J[:3].T @ GIVEN, atol=1e-13)
    np.testing.assert_allclose(body, J[:3].T @ R @ GIVEN, atol=1e-13)


def test_a_torque_in_the_axes_of_the_world_and_of_the_body():
    J, R, _ = at_frame("tip")
    world = efforts_of(lambda m, upper, lower: TorqueInput("t", lower))
    body = efforts_of(lambda m, upper, lower: TorqueInput("t", lower, axes="body"))
    np.testing.assert_allclose(world, J[3:].T @ GIVEN, atol=1e-13)
    np.testing.assert_allclose(body, J[3:].T @ R @ GIVEN, atol=1e-13)


def test_pairs_act_in_axes_of_a_and_react_on_it():
    tip, _, p_tip = at_frame("tip")
    middle, R, p = at_frame("middle")
    force = efforts_of(lambda m, upper, lower: PairForceInput("f", upper.center, lower.right))
    torque = efforts_of(lambda m, upper, lower: PairTorqueInput("t", upper.center, lower.right))
    F = R @ GIVEN
    reaction = middle[:3].T @ -F + middle[3:].T @ -np.cross(p_tip - p, F)
    np.testing.assert_allclose(force, tip[:3].T @ F + reaction, atol=1e-13)
    np.testing.assert_allclose(torque, (tip[3:] - middle[3:]).T @ F, atol=1e-13)


def test_a_tension_has_the_power_of_its_shortening():
    system = arm(
        lambda m, upper, lower: LineForceInput("rope", m.world.at(*GROUND), lower.right),
        lambda m, upper, lower: JointEffort("push", "hinge"),
    )
    idm = mbs.models.inverse_dynamics(system)
    found = np.array(idm(*STATE, [0, 0]) - idm(*STATE, [4.0, 0.25])).ravel()
    J, _, tip = at_frame("tip")
    to_ground = np.array(GROUND) - tip
    expected = J[:3].T @ to_ground * 4.0 / np.linalg.norm(to_ground)
    expected[3] += 0.25
    np.testing.assert_allclose(found, expected, atol=1e-13)
    assert [unit for _, unit in system.inputs] == ["N", "N.m"]


def test_the_unit_of_an_effort_is_that_of_its_coordinate():
    m = mbs.Mechanism("rail", gravity=(0, 0, 0))
    m.connect(m.world, Prismatic("x", axis="x"), m.add(PointMass("mass", 2.0)))
    m.add(JointEffort("push", "x"))
    system = asked(m)
    assert system.inputs == (("push.tau", "N"),)
    result = run(system, 2.0, u={"push": 3.0})
    assert result["x.q"][-1] == pytest.approx(0.5 * 1.5 * 4, abs=1e-10)


def test_torques_between_shafts_and_forces_on_slides():
    m = mbs.Mechanism("line", gravity=(0, 0, 0))
    a, b, wind = ShaftInertia("a", 0.2), ShaftInertia("b", 0.5), ShaftTorqueInput("wind")
    slide, push = SlidingMass("slide", mass=4.0), ForceSource("push")
    m.connect(a.flange_b, wind.flange_a)
    m.connect(wind.flange_b, b.flange_a)
    m.connect(push.flange, slide.flange_a)
    result = run(asked(m), 1.0, u={"wind": 3.0, "push": 2.0})
    ends = [result[f"{name}.v"][-1] for name in ("a", "b", "slide")]
    np.testing.assert_allclose(ends, [-3 / 0.2, 3 / 0.5, 2 / 4], rtol=1e-10)
    assert result["push.v"][-1] == pytest.approx(0.5, abs=1e-12)
    np.testing.assert_allclose(result["slide.tau"], 2.0, rtol=1e-15)


def swinging(kind=SpringDamperSeries):
    """A pendulum that a Maxwell element and an input pull at."""
    m = mbs.Mechanism("pendulum", gravity=(0, 0, -9.81))
    bar = m.add(Box("bar", length=0.8, mass=2.0))
    m.connect(m.world, Revolute("j", axis="y", actuated=False), bar.left)
    ground = m.world.at(0.2, 0, 1.0)
    m.add(kind("soft", ground, bar.right, stiffness=300.0, damping=60.0, length=0.5))
    m.add(ForceInput("wind", bar.right))
    return asked(m)


def test_heat_of_a_maxwell_element_is_what_the_motion_loses():
    result = run(swinging(metered(SpringDamperSeries)), 2.0, q0={"j": 0.4})
    E = stored(result, "soft")
    assert result["soft.heat"][-1] > 5
    np.testing.assert_allclose(E, E[0], rtol=0, atol=1e-8)
    T = result["soft.force"]
    stretch = 300.0 * (distance(result) - 0.5 - result["soft.elongation"])
    np.testing.assert_allclose(T, stretch, atol=1e-10)


def distance(result):
    """From the ground to the end of the bar."""
    q = result["j.q"]
    return np.hypot(0.8 * np.cos(q) - 0.2, -0.8 * np.sin(q) - 1.0)


def test_a_maxwell_element_relaxes_within_damping_over_stiffness():
    m = mbs.Mechanism("held", gravity=(0, 0, 0))
    m.connect(m.world, Prismatic("x", axis="x"), m.add(PointMass("mass", 1e9)))
    element = SpringDamperSeries(
        "soft", m.world.at(-1), m.components["mass"], stiffness=50.0, damping=20.0, length=0.8
    )
    m.add(element)
    result = run(asked(m), 1.0)
    expected = 50.0 * 0.2 * np.exp(-result.time * 50.0 / 20.0)
    np.testing.assert_allclose(result["soft.force"], expected, atol=1e-6)


def test_states_and_inputs_are_in_dae_and_the_fmu_moves_as_the_simulation(tmp_path):
    system = swinging()
    given = {"wind.x": 2.0, "wind.z": -4.0}
    expected = run(system, 0.5, q0={"j": 0.4}, u=given)
    d = mbs.models.dae(system, inputs=given, q0={"j": 0.4})
    assert [name for name, _ in d.elements["x"]] == ["j.q", "j.v", "soft.elongation"]
    options = {"abstol": 1e-12, "reltol": 1e-12}
    end = casadi.integrator("end", "cvodes", d.casadi(), 0, 0.5, options)
    x = np.array(end(x0=d.x0, u=d.u0, p=d.p0)["xf"]).ravel()
    names = ("j.q", "j.v", "soft.elongation")
    np.testing.assert_allclose(x, [expected[name][-1] for name in names], atol=1e-9)
    path = mbs.export.fmu(system, tmp_path / "pendulum.fmu")
    start = {"j.q": 0.4, **given}
    result = mbs.simulate.fmu(path, 0.5, start=start, step=0.01, tolerance=1e-10, quiet=True)
    for name in (*names, "soft.force"):
        np.testing.assert_allclose(result[name], expected[name], atol=1e-7)


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (lambda p: ForceInput("f", p, axes="tool"), ["f: axes is 'tool'", "'world', or 'body'"]),
        (lambda p: TorqueInput("f", p, axes=None), ["f: axes is None"]),
        (lambda p: ForceInput("f", "tip"), ["f: point is 'tip'", "body.at"]),
        (lambda p: LineForceInput("f", p, 3), ["f: b is 3"]),
        (lambda p: JointEffort("f", 3.0), ["f: joint is 3.0", "name of a coordinate"]),
        (
            lambda p: SpringDamperSeries("f", p, p, stiffness=0, damping=1),
            ["f: stiffness is 0 N/m"],
        ),
        (
            lambda p: SpringDamperSeries("f", p, p, stiffness=1, damping=-2),
            ["f: damping is -2 N.s/m"],
        ),
    ],
)
def test_what_is_refused(make, parts):
    point = mbs.Mechanism("m").world.at(1)
    refused(DescriptionError, *parts, by=lambda: make(point))


def test_a_placed_mechanism_brings_its_inputs():
    inner = mbs.Mechanism("inner", gravity=(0, 0, 0))
    mass = inner.add(PointMass("mass", 2.0))
    inner.connect(inner.world, Prismatic("x", axis="x"), mass)
    inner.add(ForceInput("push", mass))
    outer = mbs.Mechanism("outer", gravity=(0, 0, 0))
    outer.connect(outer.world, Fixed("weld"), outer.add(inner, "left").base)
    system = asked(outer)
    assert [name for name, _ in system.inputs] == ["left.push.x", "left.push.y", "left.push.z"]
    result = run(system, 1.0, u={"left.push.x": 3.0})
    assert result["left.x.v"][-1] == pytest.approx(1.5, abs=1e-12)
