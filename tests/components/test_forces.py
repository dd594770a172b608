"""Laws of force elements by hand, and what their descriptions refuse."""

import re
from dataclasses import replace

import casadi
import numpy as np
import pytest
from casadi import SX
from support.closed_mechanisms import planar_loop
from support.messages import refused

import mbs
import mbs.models
from mbs.components import (
    Body,
    Bushing,
    CoulombFriction,
    Damper,
    FixedTendon,
    Force,
    Free,
    JointFriction,
    JointStop,
    PointGravity,
    PointMass,
    Prismatic,
    Revolute,
    Spherical,
    Spring,
    SpringFrictionSeries,
    Torque,
)
from mbs.errors import AssemblyError, DescriptionError


def one_joint(joint=None, name="m"):
    """A body without weight on one joint."""
    m = mbs.Mechanism(name, gravity=(0, 0, 0))
    body = m.add(Body("b", mass=2.0, inertia=(0.1, 0.2, 0.3)))
    m.connect(m.world, joint or Prismatic("x", axis="x", actuated=True), body)
    return m, body


def effort(m, q, v=0.0):
    system = m.assemble()
    return float(mbs.models.bias(system)(q, v))


def test_spring_and_damper_along_a_line():
    m, b = one_joint()
    m.add(Spring("s", m.world.at(0, 3, 0), b, stiffness=10, length=2, damping=4))
    q, v, L = 4.0, 0.5, 5.0
    assert effort(m, q, v) == pytest.approx((10 * (L - 2) + 4 * q * v / L) * q / L, rel=1e-13)
    m.add(Damper("d", b, m.world.at(0, 3, 0), damping=6))
    assert effort(m, q, v) == pytest.approx((10 * (L - 2) + 10 * q * v / L) * q / L, rel=1e-13)


def test_a_line_element_is_regular_where_its_points_coincide():
    m, b = one_joint()
    m.add(Spring("s", m.world, b, stiffness=10, length=2, damping=4))
    system = m.assemble()
    q, v = SX.sym("q"), SX.sym("v")
    H = mbs.models.bias(system)(q, v)
    slopes = casadi.Function("f", [q, v], [H, casadi.jacobian(H, q), casadi.jacobian(H, v)])
    assert all(np.isfinite(float(x)) for x in slopes(0, 1.0))
    assert float(slopes(0, 1.0)[0]) == 0
    assert float(slopes(1e-6, 0)[0]) == pytest.approx(10 * (1e-6 - 2), rel=1e-9)


def test_spring_without_free_length_pulls_in_every_direction():
    m = mbs.Mechanism("ball", gravity=(0, 0, 0))
    b = m.add(Body("b", mass=1, inertia=(1, 1, 1)))
    m.connect(m.world, Free("f"), b)
    m.add(Spring("s", m.world, b, stiffness=7))
    system = m.assemble()
    Q = mbs.models.gravity_effort(system)([0.1, -0.2, 0.3, 1, 0, 0, 0])
    np.testing.assert_allclose(np.array(Q).ravel(), [0.7, -1.4, 2.1, 0, 0, 0], atol=1e-12)


def test_the_joint_transmits_the_force_of_a_spring():
    """Across the rail the guide holds it: the whole tension 10 (5 - 2) passes through the joint."""
    m, b = one_joint()
    m.add(Spring("s", m.world.at(0, 3, 0), b.at(0, 0, 0.1), stiffness=10, length=2))
    annotated = mbs.models.inverse_dynamics(m.assemble()).annotated()
    names = annotated.name_out()
    values = [float(x) for x in annotated(4.0, 0, 0)]
    joint = [x for name, x in zip(names, values, strict=True) if re.fullmatch("E[123]1", name)]
    assert np.linalg.norm(joint) == pytest.approx(10 * (np.hypot(5, 0.1) - 2), rel=1e-12)


def test_points_on_the_frames_of_a_joint():
    """A spring between the two frames of a joint acts along it."""
    m, _ = one_joint()
    joint = m.components["x"]
    m.add(Spring("s", joint.frame_a, joint.frame_b.at(0.5), stiffness=10, length=0.2))
    assert effort(m, 0.3) == pytest.approx(10 * (0.8 - 0.2))


def test_attraction_falls_with_the_square_of_the_distance():
    m, b = one_joint()
    m.add(PointGravity("g", m.world, b, strength=8))
    assert effort(m, 2.0) == pytest.approx(2.0)
    system = m.assemble()
    assert float(mbs.models.energy(system)(2.0, 0)[1]) == pytest.approx(-4.0)


@pytest.mark.parametrize("angle", [0.0, 0.3, -1.2, 2.5])
def test_bushing_about_one_axis(angle):
    """Angle 2 sin(angle / 2): energy k (1 - cos), moment k sin, damping cos^2(angle / 2)."""
    m, b = one_joint(Revolute("r", axis="y", actuated=True))
    m.add(Bushing("u", m.world, b, angular_stiffness=(1, 5, 2), angular_damping=(1, 3, 2)))
    v = 0.7
    expected = 5 * np.sin(angle) + 3 * np.cos(angle / 2) ** 2 * v
    assert effort(m, angle, v) == pytest.approx(expected, rel=1e-12, abs=1e-14)
    _, U = mbs.models.energy(m.assemble())(angle, 0)
    assert float(U) == pytest.approx(5 * (1 - np.cos(angle)), abs=1e-14)


def test_bushing_is_the_matrix_of_its_stiffness_for_small_motions():
    m = mbs.Mechanism("mount", gravity=(0, 0, 0))
    b = m.add(Body("b", mass=1, inertia=(1, 1, 1)))
    m.connect(m.world, Free("f"), b)
    K, K_phi, C, C_phi = (1, 2, 3), (4, 5, 6), (7, 8, 9), (10, 11, 12)
    m.add(
        Bushing(
            "u", m.world, b, stiffness=K, angular_stiffness=K_phi, damping=C, angular_damping=C_phi
        )
    )
    bias = mbs.models.bias(m.assemble())
    small = 1e-7 * np.arange(1, 7)
    q = [*small[:3], 1, *small[3:] / 2]
    np.testing.assert_allclose(np.array(bias(q, 6 * [0])).ravel(), small * [*K, *K_phi], rtol=1e-5)
    v = 1e-3 * np.arange(1, 7)
    at_rest = np.array(bias([0, 0, 0, 1, 0, 0, 0], v)).ravel()
    rigid = np.array(bias([100, 0, 0, 1, 0, 0, 0], v)).ravel()
    gyroscopic = np.cross(v[3:], v[:3])
    np.testing.assert_allclose(at_rest[:3] - gyroscopic, v[:3] * C, rtol=1e-12)
    np.testing.assert_allclose(at_rest[3:], v[3:] * C_phi, rtol=1e-12)
    assert not np.allclose(rigid, at_rest)


@pytest.mark.parametrize(
    ("q", "force", "energy"),
    [
        (0.0, 0.0, 0.0),
        (1.0, 0.0, 0.0),
        (1.05, 100 * 0.1 * (0.125 - 0.0625 / 2), None),
        (1.1, 100 * 0.05, 100 * 0.01 * 0.15),
        (1.5, 100 * 0.45, 100 * (0.0015 + 0.5 * 0.16 + 0.05 * 0.4)),
        (-0.5, 0.0, 0.0),
        (-0.9, -100 * 0.35, None),
    ],
)
def test_stop(q, force, energy):
    m, _ = one_joint()
    m.add(JointStop("stop", joint="x", lower=-0.5, upper=1, stiffness=100, width=0.1))
    assert effort(m, q) == pytest.approx(force, rel=1e-12, abs=1e-15)
    U = mbs.models.energy(m.assemble())
    if energy is not None:
        assert float(U(q, 0)[1]) == pytest.approx(energy, rel=1e-12, abs=1e-15)
    slope = (float(U(q + 1e-6, 0)[1]) - float(U(q - 1e-6, 0)[1])) / 2e-6
    assert slope == pytest.approx(force, abs=1e-7)


def test_stop_damps_only_where_it_is_touched():
    m, _ = one_joint()
    m.add(JointStop("stop", joint="x", upper=1, stiffness=100, damping=20, width=0.1))
    assert effort(m, 0.99, 3.0) == 0
    assert effort(m, 1.05, 0.05) - effort(m, 1.05) == pytest.approx(0.5 * 20 * 0.05)
    assert effort(m, 1.3, -1.0) - effort(m, 1.3) == pytest.approx(-20)
    # at most as much as the spring: it never pulls
    assert effort(m, 1.05, 3.0) == pytest.approx(2 * effort(m, 1.05))
    assert effort(m, 1.3, -3.0) == pytest.approx(0.0, abs=1e-12)


def test_friction():
    m, _ = one_joint()
    law = dict(coulomb=3, stribeck=2, velocity=0.1, viscous=0.5, width=0.01)
    m.add(JointFriction("friction", joint="x", **law))
    assert effort(m, 0.2, 0.0) == 0
    for v in (-0.3, -0.02, 1e-3, 0.05, 2.0):
        dry = 3 + 2 * np.exp(-((v / 0.1) ** 2))
        assert effort(m, 0.2, v) == pytest.approx(dry * np.tanh(v / 0.01) + 0.5 * v, rel=1e-13)


def test_friction_of_a_ball_joint_acts_on_one_of_its_velocities():
    m, _ = one_joint(Spherical("ball"))
    m.add(JointFriction("friction", joint="ball.wy", viscous=2))
    bias = mbs.models.bias(m.assemble())
    plain = mbs.models.bias(one_joint(Spherical("ball"))[0].assemble())
    q, v = [1, 0, 0, 0], [0.1, 0.2, 0.3]
    np.testing.assert_allclose(np.array(bias(q, v) - plain(q, v)).ravel(), [0, 0.4, 0], atol=1e-15)


@pytest.mark.parametrize(
    ("call", "parts"),
    [
        (
            lambda m, b: Spring("s", m.world, b, stiffness=-1),
            ["s: stiffness is -1", "zero or more"],
        ),
        (lambda m, b: Spring("s", m.world, b, stiffness=1, length=-2), ["s: length is -2"]),
        (
            lambda m, b: Spring("s", m.world, b, stiffness=0),
            ["s: stiffness and damping are zero", "the Spring does nothing"],
        ),
        (lambda m, b: Spring("s", m.world, "b", stiffness=1), ["s: b is 'b'; give a body"]),
        (lambda m, b: Spring("s", None, b, stiffness=1), ["s: a is None; give a body"]),
        (lambda m, b: Damper("d", m.world, b, damping=0), ["d: damping is zero", "leave it out"]),
        (lambda m, b: Damper("d", m.world, b, damping=-1), ["d: damping is -1"]),
        (lambda m, b: PointGravity("g", m.world, b, strength=0), ["g: strength is zero"]),
        (lambda m, b: Bushing("u", m.world, b), ["u: stiffness and damping", "does nothing"]),
        (
            lambda m, b: Bushing("u", m.world, b, stiffness=(1, 2)),
            ["u, stiffness: (1, 2) has not three values"],
        ),
        (lambda m, b: Bushing("u", m.world, b, damping=(1, -2, 0)), ["u: damping is -2"]),
        (lambda m, b: Force("f", b, force=(0, 0, 0)), ["f: force is zero"]),
        (lambda m, b: Force("f", b, force=3), ["f, force: 3 has not three values"]),
        (lambda m, b: Torque("t", b, torque=(1, 0, 0), axes="x"), ["t: axes is 'x'; use 'world'"]),
        (
            lambda m, b: JointStop("p", joint="x", stiffness=1, width=1),
            ["p: a stop has neither lower nor upper"],
        ),
        (
            lambda m, b: JointStop("p", joint="x", lower=2, upper=1, stiffness=1, width=1),
            ["p: lower is 2 and upper is 1; give them in order"],
        ),
        (
            lambda m, b: JointStop("p", joint="x", upper=1, stiffness=1, width=0),
            ["p: width is 0; give more than zero"],
        ),
        (lambda m, b: JointStop("p", joint="x", upper=1, stiffness=0, width=1), ["stiffness is 0"]),
        (
            lambda m, b: JointStop("p", joint=b, upper=1, stiffness=1, width=1),
            ["p: joint is Body", "give the name of a coordinate"],
        ),
        (lambda m, b: JointFriction("p", joint="x"), ["coulomb and stribeck and viscous are zero"]),
        (
            lambda m, b: JointFriction("p", joint="x", coulomb=1, width=0),
            ["p: width is 0; give more than zero"],
        ),
        (lambda m, b: JointFriction("p", joint="x", coulomb=-1), ["p: coulomb is -1"]),
    ],
)
def test_descriptions_refused(call, parts):
    m, b = one_joint()
    refused(DescriptionError, *parts, by=lambda: call(m, b))


@pytest.mark.parametrize(
    ("element", "parts"),
    [
        (
            lambda m, b: Spring("s", b, b.at(1, 0, 0), stiffness=1),
            ["s: what it acts on, b and b, is one rigid body", "act on another body"],
        ),
        (
            lambda m, b: Spring("s", m.world, m.world.at(1), stiffness=1),
            ["s: what it acts on, world and world, does not move"],
        ),
        (
            lambda m, b: Force("f", m.world, force=(1, 0, 0)),
            ["f: what it acts on, world, does not move, so that the Force does nothing"],
        ),
        (
            lambda m, b: Spring("s", Body("b", mass=0), m.world, stiffness=1),
            ["s: it acts on 'b', which is not part of m"],
        ),
        (
            lambda m, b: Spring("s", Body("other", mass=0), m.world, stiffness=1),
            ["s: it acts on 'other', which is not part of m"],
        ),
        (
            lambda m, b: JointStop("p", joint="y", upper=1, stiffness=1, width=1),
            ["p: there is no coordinate 'y' in the tree that a JointStop can act on", "x"],
        ),
        (
            lambda m, b: JointFriction("p", joint="b", viscous=1),
            ["p: there is no coordinate 'b'"],
        ),
    ],
)
def test_assemblies_refused(element, parts):
    m, b = one_joint()
    m.add(element(m, b))
    refused(AssemblyError, *parts, by=m.assemble)


def test_a_joint_that_must_be_cut_is_named():
    """In a loop one joint is cut, unless something of its own keeps it in the tree."""
    m, guess = planar_loop(0, links=3)
    for name in ("j0", "j1", "j2", "closing"):
        m.add(JointFriction(f"f_{name}", joint=name, viscous=1))
    refused(
        AssemblyError,
        "f_j2: the joint of 'j2' is cut to open a loop",
        "give that joint some friction Fv of its own",
        by=lambda: m.assemble(guess=guess),
    )
    m.components["j2"] = replaced = replace(m.components["j2"], Fv=1e-6)
    m.connections = [
        tuple(replace(p, owner=replaced) if p.owner.name == "j2" else p for p in pair)
        for pair in m.connections
    ]
    assert len(m.assemble(guess=guess).parts) == 4


def test_a_stop_needs_a_position():
    m, _ = one_joint(Spherical("ball"))
    m.add(JointStop("p", joint="ball.wx", upper=1, stiffness=1, width=1))
    refused(AssemblyError, "p: there is no coordinate 'ball.wx'", by=m.assemble)


def test_values_of_symbols_are_checked():
    m, b = one_joint()
    m.add(Spring("s", m.world.at(0, 1, 0), b, stiffness="k"))
    m.values = {"k": mbs.Parameter("k", -3.0)}
    refused(DescriptionError, "s: stiffness is -3", by=m.assemble)


def test_symbols_in_elements():
    def build(k, x):
        m, b = one_joint()
        m.add(Spring("s", m.world.at(0, x, 0), b, stiffness=k, length="L" if k == "k" else 0.5))
        m.add(JointStop("p", joint="x", upper=0.1, stiffness=k, width=0.2))
        m.add(Force("f", b, force=(k, 0, 0)))
        m.add(Bushing("u", m.world, b, stiffness=k))
        return m.assemble()

    symbolic, plain = build("k", "h"), build(5.0, 2.0)
    values = {"k": 5.0, "h": 2.0, "L": 0.5}
    assert {p.name for p in symbolic.parameters} == set(values)
    p = [values[row.name] for row in symbolic.parameters]
    for model in (mbs.models.inverse_dynamics, mbs.models.direct_dynamics):
        one, other = model(symbolic)(0.3, 0.4, 0.5, p), model(plain)(0.3, 0.4, 0.5)
        assert float(one) == pytest.approx(float(other), rel=1e-13)


def test_elements_of_a_mechanism_inside_another_one():
    inner, b = one_joint(name="inner")
    inner.add(Spring("s", inner.world.at(0, "h", 0), b, stiffness="k", length=1))
    inner.add(JointStop("p", joint="x", upper=0.1, stiffness="k", width=0.2))
    inner.values = {"k": mbs.Parameter("k", 4.0), "h": mbs.Parameter("h", 2.0)}
    outer = mbs.Mechanism("outer", gravity=(0, 0, 0))
    for name in ("left", "right"):
        placed = outer.add(inner, name)
        outer.connect(outer.world.at(0, 0, 1), placed.base)
    whole, alone = outer.assemble(), inner.assemble()
    assert [force.element.name for force in whole.parts] == [
        "left.s",
        "left.p",
        "right.s",
        "right.p",
    ]
    H = np.array(mbs.models.bias(whole)([0.3, -0.4], [0, 0])).ravel()
    expected = [float(mbs.models.bias(alone)(q, 0)) for q in (0.3, -0.4)]
    np.testing.assert_allclose(H, expected, rtol=1e-13)


def test_report_tells_of_elements():
    m, b = one_joint()
    m.add(Spring("s", m.world.at(0, 1, 0), b, stiffness=1))
    m.add(JointStop("p", joint="x", upper=0.1, stiffness=1, width=0.2))
    m.add(Force("f", b, force=(1, 0, 0)))
    lines = m.assemble().report().splitlines()
    assert lines[-3:] == [
        "Spring s acts between world and b.",
        "JointStop p acts on x.",
        "Force f acts on b.",
    ]


# Fixed tendons.


def two_sliders(**options):
    m = mbs.Mechanism("sliders", gravity=(0, 0, 0))
    before = m.world
    for name in ("s1", "s2"):
        body = m.add(Body(name + "_body", mass=1.0, inertia=(1, 1, 1)))
        m.connect(before, Prismatic(name, axis="x"), body)
        before = body
    m.add(FixedTendon("t", levers=(("s1", 2.0), ("s2", "-c")), **options))
    return m


@pytest.mark.parametrize(
    ("q", "stretch"), [((1.0, 0.2), 1.3), ((-1.0, 0.2), -1.9), ((0.1, 0.2), 0.0)]
)
def test_a_fixed_tendon_pulls_by_its_levers_and_is_slack_between(q, stretch):
    m = two_sliders(stiffness=10, length=(-0.5, 0.3), damping=3)
    m.values["c"] = mbs.Parameter("c", 2.0)
    system = m.assemble()
    x, rate = 2 * q[0] - 2 * q[1], 2 * 0.5 - 2 * 0.1
    assert x - 0.3 == pytest.approx(stretch) or stretch <= 0
    tension = 10 * stretch + 3 * rate
    tau = np.array(mbs.models.inverse_dynamics(system)(q, (0.5, 0.1), 0)).ravel()
    np.testing.assert_allclose(tau, [2 * tension, -2 * tension], atol=1e-13)
    _, U = mbs.models.energy(system)(q, 0)
    assert float(U) == pytest.approx(5 * stretch**2, abs=1e-14)


def test_friction_of_a_fixed_tendon_and_its_scope():
    inner = two_sliders(friction=4, width=0.1)
    inner.values["c"] = mbs.Parameter("c", 1.0)
    m = mbs.Mechanism("outer", gravity=(0, 0, 0))
    m.connect(m.world, m.add(inner, name="in").base)
    system = m.assemble()
    tau = np.array(mbs.models.inverse_dynamics(system)(0, (0.1, 0.1), 0)).ravel()
    force = 4 * np.tanh(0.1 / 0.1)
    np.testing.assert_allclose(tau, [2 * force, -force], atol=1e-14)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"levers": ()}, "t: levers .. are not pairs of a coordinate and a lever"),
        ({"levers": (("a", 1), ("a", 2))}, "each coordinate once"),
        ({"levers": 3}, "t: levers 3 are not pairs"),
        ({"length": (1, 0)}, r"t: length is .1, 0.; give the smaller one first"),
        ({"length": (1, 2, 3)}, "is neither one length nor two"),
        ({"stiffness": -1}, "t: stiffness is -1; give zero or more"),
        ({"stiffness": 0}, "the FixedTendon does nothing"),
    ],
)
def test_a_fixed_tendon_that_is_none_is_refused(options, message):
    given = {"levers": (("a", 1.0),), "stiffness": 1.0, **options}
    with pytest.raises(DescriptionError, match=message):
        FixedTendon("t", **given)


def jenkins(parallel=0.0, *, node=None):
    """A mass on a spring that ends at dry friction: as one element, or with a node of a mass."""
    m = mbs.Mechanism("jenkins")
    body = m.add(PointMass("body", mass=2.0))
    m.connect(m.world, Prismatic("x", axis="x"), body)
    m.add(Spring("side", m.world.at(-1), body, stiffness=100.0, length=1.0))
    both = {"stiffness": 600.0, "length": 1.0}
    if node is None:
        m.add(
            SpringFrictionSeries("e", m.world.at(-1), body, friction=5.0, parallel=parallel, **both)
        )
        return m
    knot = m.add(PointMass("knot", mass=node))
    m.connect(m.world, Prismatic("n", axis="x", stiffness=parallel), knot)
    m.add(Spring("s", knot, body.at(1.0), **both))
    m.add(CoulombFriction("f", "n", sliding=5.0))
    return m


@pytest.mark.parametrize("parallel", [0.0, 60.0])
def test_a_spring_in_series_with_friction_has_the_loop_of_a_jenkins_element(parallel):
    amplitude, k, limit = 0.05, 600.0, 5.0
    result = mbs.simulate.run(
        jenkins(parallel).assemble(),
        2.0,
        motion={"x.q": lambda t: amplitude * casadi.sin(2 * np.pi * t)},
        step=1e-3,
        tolerance=1e-9,
    )
    force, x, z = result["e.force"][1000:], result["x.q"][1000:], result["e.slip"][1000:]
    area = np.sum((force[1:] + force[:-1]) / 2 * np.diff(x))
    # while it sticks, x moves by 2 limit / k; while it slides, z moves by k / (k + K) of x
    travel = (2 * amplitude - 2 * limit / k) * k / (k + parallel)
    assert area == pytest.approx(2 * limit * travel, rel=1e-4)
    assert np.ptp(z) == pytest.approx(travel, rel=1e-4)
    assert np.abs(force - parallel * z).max() == pytest.approx(limit, abs=1e-9)


def test_a_spring_in_series_with_friction_is_as_a_node_of_little_mass(tmp_path):
    system = jenkins(60.0).assemble()
    result = mbs.simulate.run(system, 1.0, v0={"x": 1.0}, tolerance=1e-9)
    assert np.unique(np.sign(np.diff(result["e.slip"]))).tolist() == [-1, 0, 1]
    small = jenkins(60.0, node=1e-5).assemble()
    other = mbs.simulate.run(small, 1.0, v0={"x": 1.0}, tolerance=1e-6, method="rodas")
    np.testing.assert_allclose(result["x.q"], other["x.q"], atol=1e-4)
    # the little mass oscillates by the speed times sqrt(1e-5 / 600)
    np.testing.assert_allclose(result["e.slip"], other["n.q"], atol=2e-4)
    path = mbs.export.fmu(system, tmp_path / "jenkins.fmu")
    for kind in ("CoSimulation", "ModelExchange"):
        options = {"start": {"x.v": 1.0}, "tolerance": 1e-9, "quiet": True}
        found = mbs.simulate.fmu(path, 1.0, kind=kind, **options)
        at = np.interp(found.time, result.time, result["x.q"])
        assert np.abs(found["x.q"][-1] - at[-1]) < 1e-6


def test_friction_behind_a_spring_slides_from_the_start_where_it_is_stretched_too_far():
    """It begins with the force of sliding, and the energy falls by what it takes."""
    result = mbs.simulate.run(
        jenkins().assemble(), 0.5, q0={"x": 0.1}, v0={"x": 0.2}, tolerance=1e-9
    )
    assert result["e.force"][1] == pytest.approx(5.0, abs=1e-9)
    energy = result["kinetic_energy"] + result["potential_energy"]
    assert (np.diff(energy[1:]) < 1e-8).all()
