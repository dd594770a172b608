"""Nodes without mass between springs and dampers: their velocities follow from the forces."""

import pickle

import casadi
import numpy as np
import pytest
from support.everywhere import agree

import mbs
from mbs.components import (
    Body,
    Box,
    Cartesian,
    CoulombFriction,
    Damper,
    FixedTendon,
    ForceInput,
    JointFriction,
    PointMass,
    Prismatic,
    Revolute,
    RigidStop,
    Spring,
    SpringDamperSeries,
)

K, C, MASS = 600.0, 20.0, 2.0


def element(*, parallel=0.0, damping=C, node=0.0, parameters=None):
    """A mass on a spring that ends at a node, which a damper holds, and a spring if wanted."""
    m = mbs.Mechanism("element", parameters=parameters)
    body, knot = m.add(PointMass("body", mass=MASS)), m.add(PointMass("knot", mass=node))
    m.connect(m.world, Prismatic("x", axis="x"), body)
    m.connect(m.world, Prismatic("n", axis="x"), knot)
    m.add(Damper("d", m.world.at(-1), knot.at(), damping=damping))
    m.add(Spring("s", knot.at(), body.at(), stiffness=K, length=1.0))
    if parallel:
        for k, share in enumerate((0.25, 0.75)):
            own = Spring(f"p{k}", m.world.at(-1), knot.at(), stiffness=share * parallel, length=1)
            m.add(own)
    return m


def exact(time, parallel=0.0, damping=C):
    """Displacements of mass and node, released at 0.1 with the node at zero."""
    A = [[0, 1, 0], [-K / MASS, 0, K / MASS], [K / damping, 0, -(K + parallel) / damping]]
    eigenvalues, vectors = np.linalg.eig(np.array(A))
    weights = np.linalg.solve(vectors, [0.1, 0.0, 0.0])
    found = np.real((weights * np.exp(np.outer(time, eigenvalues))) @ vectors.T)
    return found[:, 0], found[:, 2]


@pytest.mark.parametrize("parallel", [0.0, 300.0])
@pytest.mark.parametrize("options", [{}, {"method": "rodas"}], ids=["dopri", "rodas"])
def test_a_spring_and_a_damper_in_series(parallel, options):
    system = element(parallel=parallel).assemble(guess={"x": 1.0})
    assert [system.velocity_coordinates[k].name for k in system.independent] == ["x"]
    assert "The balance of forces gives the velocities of n" in system.report()
    result = mbs.simulate.run(system, 1.0, q0={"x": 1.1}, tolerance=1e-10, **options)
    x, n = exact(result.time, parallel)
    np.testing.assert_allclose(result["x.q"] - 1, x, atol=1e-9)
    np.testing.assert_allclose(result["n.q"], n, atol=1e-9)
    np.testing.assert_allclose(C * result["n.v"], K * (x - n) - parallel * n, atol=1e-6)


def test_a_strong_and_a_weak_damper():
    """A damper of 1e-3 N s/m relaxes the spring within 2 us: the equations are stiff."""
    for damping in (1e-3, 1e4):
        system = element(parallel=300.0, damping=damping).assemble(guess={"x": 1.0})
        options = {"method": "rodas", "tolerance": 1e-8}
        result = mbs.simulate.run(system, 0.5, q0={"x": 1.1}, **options)
        x, n = exact(result.time, 300.0, damping)
        np.testing.assert_allclose(result["x.q"] - 1, x, atol=1e-6)
        np.testing.assert_allclose(result["n.q"], n, atol=1e-6)


def test_it_equals_the_component_for_both():
    m = mbs.Mechanism("series")
    body = m.add(PointMass("body", mass=MASS))
    m.connect(m.world, Prismatic("x", axis="x"), body)
    m.add(SpringDamperSeries("s", m.world, body, stiffness=K, damping=C, length=1.0))
    start = {"q0": {"x": 1.1}, "v0": {"x": 0.3}, "tolerance": 1e-10}
    one = mbs.simulate.run(m.assemble(guess={"x": 1.0}), 1.0, **start)
    two = mbs.simulate.run(element().assemble(guess={"x": 1.0}), 1.0, **start)
    np.testing.assert_allclose(two["x.q"], one["x.q"], atol=1e-10)
    np.testing.assert_allclose(two["n.q"], one["s.elongation"], atol=1e-10)


@pytest.mark.parametrize("parallel", [0.0, 300.0])
def test_every_integration_gives_the_same_motion(parallel, tmp_path):
    system = element(parallel=parallel).assemble(guess={"x": 1.1})
    agree(system, tmp_path, 0.5, ["x.q", "n.q"], v0={"x": 0.3})


def test_models_of_a_spring_and_a_damper_in_series():
    system = element().assemble(guess={"x": 1.0})
    q, v = np.array([1.1, 0.03]), 0.2
    force = K * 0.07
    for one in (system, pickle.loads(pickle.dumps(system))):
        assert float(mbs.models.direct_dynamics(one)(q, v, 0)) == pytest.approx(-force / MASS)
    assert float(mbs.models.inverse_dynamics(system)(q, v, 0)) == pytest.approx(force)
    whole = mbs.models.direct_dynamics(system, coordinates="tree")(q, [v, force / C], [0, 0])
    expected = [-force / MASS, K * (v - force / C) / C]
    np.testing.assert_allclose(whole[0].full().ravel(), expected)
    np.testing.assert_allclose(whole[1].full(), 0, atol=1e-12)  # no force through the row
    T, U = mbs.models.energy(system)(q, v)
    assert (float(T), float(U)) == pytest.approx((MASS * v**2 / 2, K * 0.07**2 / 2))
    A, B, Q = mbs.models.lagrange(system)(q, v)
    assert (float(A), float(B), float(Q)) == pytest.approx((MASS, 0.0, force))
    A = mbs.models.linearise(system).at(q0={"x": 1.0}).A
    exact_A = [[0, 0, 1], [K / C, -K / C, 0], [-K / MASS, K / MASS, 0]]
    np.testing.assert_allclose(A, exact_A, atol=1e-9)


def test_a_damping_may_be_a_parameter_and_a_state_a_start():
    system = element(damping="c", parameters={"c": C}).assemble(guess={"x": 1.0})
    start = {"q0": {"x": 1.1}, "tolerance": 1e-10, "step": 0.01}
    result = mbs.simulate.run(system, 1.0, parameters={"c": 5.0}, **start)
    x, n = exact(result.time, damping=5.0)
    np.testing.assert_allclose(result["n.q"], n, atol=1e-9)
    options = {"parameters": {"c": 5.0}, "tolerance": 1e-10}
    rest = mbs.simulate.run(system, 0.5, q0=result.state(0.5), **options)
    assert rest["x.q"][-1] == pytest.approx(1 + x[-1], abs=1e-9)
    cases = mbs.simulate.sweep(system, {"c": [5.0, 50.0]}, 1.0, quiet=True, **start)
    for case, found in cases:
        n = exact(found.time, damping=case["c"])[1]
        np.testing.assert_allclose(found["n.q"], n, atol=1e-9)


def test_two_nodes_in_a_chain():
    """Spring, node, damper, node, spring: the springs balance, and the damper lets them move."""
    m = mbs.Mechanism("chain")
    body = m.add(PointMass("body", mass=MASS))
    one, two = (m.add(PointMass(name, mass=0)) for name in ("one", "two"))
    for name, part in {"n1": one, "n2": two, "x": body}.items():
        m.connect(m.world, Prismatic(name, axis="x"), part)
    m.add(Spring("s1", m.world.at(-1), one.at(), stiffness=400, length=1.0))
    m.add(Damper("d", one.at(), two.at(0.5), damping=C))
    m.add(Spring("s2", two.at(), body.at(), stiffness=K, length=1.0))
    system = m.assemble(guess={"n2": 0.5, "x": 1.5})
    assert [system.velocity_coordinates[k].name for k in system.independent] == ["x"]
    result = mbs.simulate.run(system, 1.0, q0={"x": 1.6}, tolerance=1e-10)
    np.testing.assert_allclose(400 * result["n1.q"], K * (result["x.q"] - result["n2.q"] - 1))
    opened = result["n2.q"] - result["n1.q"] - 0.5
    m = mbs.Mechanism("series")
    body = m.add(PointMass("body", mass=MASS))
    m.connect(m.world, Prismatic("x", axis="x"), body)
    both = SpringDamperSeries(
        *("s", m.world.at(-1), body),
        stiffness=400 * K / (400 + K),
        damping=C,
        length=2.5,
        elongation=float(opened[0]),
    )
    m.add(both)
    other = mbs.simulate.run(m.assemble(guess={"x": 1.5}), 1.0, q0={"x": 1.6}, tolerance=1e-10)
    np.testing.assert_allclose(result["x.q"], other["x.q"], atol=1e-10)
    np.testing.assert_allclose(opened, other["s.elongation"], atol=1e-10)


def knotted(mass, dampings):
    """Three springs with dampers from the ground to a knot, from which a mass hangs."""
    m = mbs.Mechanism("knotted", gravity=(0, -9.81, 0))
    knot, body = m.add(PointMass("knot", mass=mass)), m.add(PointMass("body", mass=1.5))
    m.connect(m.world, Cartesian("k"), knot)
    m.connect(m.world, Cartesian("b"), body)
    places = [(-0.5, 0.3, 0.1), (0.6, 0.4, 0.0), (0.0, 0.5, -0.5)]
    for k, (place, damping) in enumerate(zip(places, dampings, strict=True)):
        own = {"stiffness": 200 + 20 * k, "length": 0.3, "damping": damping}
        m.add(Spring(f"s{k}", m.world.at(*place), knot.at(), **own))
    m.add(Spring("hang", knot.at(), body.at(), stiffness=150.0, length=0.4))
    return m


def arm(mass):
    """A node that slides along a link that rotates, with friction of its joint."""
    m = mbs.Mechanism("arm", gravity=(0, -9.81, 0))
    bar = m.add(Box("bar", length=0.5, mass=1.0))
    node, tip = m.add(PointMass("node", mass=mass)), m.add(PointMass("tip", mass=0.3))
    m.connect(m.world, Revolute("j", axis="z"), bar.left)
    m.connect(bar.right, Prismatic("n", axis="x", Fv=4.0, stiffness=50.0), node)
    m.connect(bar.right, Prismatic("x", axis="x"), tip)
    m.add(Spring("s", node, tip, stiffness=300.0, damping=2.0, length=0.1))
    return m


def hub(mass):
    """A hub on a torsion spring with friction, and a wheel that a tendon connects to it."""
    m = mbs.Mechanism("hub", gravity=(0, 0, 0))
    part = Body("hub", mass=mass, inertia=(mass,) * 3) if mass else PointMass("hub", mass=0)
    wheel = m.add(Body("wheel", mass=1.0, inertia=(0.1, 0.1, 0.15)))
    m.connect(m.world, Revolute("a", axis="z", stiffness=2.0, Fv=0.3), m.add(part))
    m.connect(m.world, Revolute("b", axis="z"), wheel)
    m.add(FixedTendon("t", levers=(("a", 1.0), ("b", -1.0)), stiffness=3.0, damping=0.1))
    return m


def on_a_four_bar(mass):
    """A node on a link of a loop, between a damper and a spring."""
    m = mbs.robots.four_bar()
    bar = next(iter(m.bodies()))
    node, tip = m.add(PointMass("node", mass=mass)), m.add(PointMass("tip", mass=0.2))
    m.connect(bar, Prismatic("n", axis="x"), node)
    m.connect(bar, Prismatic("x", axis="x"), tip)
    m.add(Damper("d", bar, node, damping=30.0))
    m.add(Spring("s", node, tip, stiffness=5000.0, length=0.1))
    m.add(Spring("p", bar, tip, stiffness=500.0, length=0.2))
    return m


SMALL = {
    "three dampers": (lambda m: knotted(m, (3, 4, 5)), {"b.x": 0.1, "b.y": -0.2, "b.z": 0.05}),
    "one damper": (lambda m: knotted(m, (3, 0, 0)), {"b.x": 0.1, "b.y": -0.2, "b.z": 0.05}),
    "on a link": (arm, {"j": 0.5, "x": 0.12}),
    "rotation": (hub, {"b": 0.7}),
    "on a loop": (on_a_four_bar, {"j1": 0.3, "n": 0.1, "x": 0.21}),
}


@pytest.mark.parametrize("name", SMALL)
def test_a_node_is_as_one_of_little_mass(name):
    build, start = SMALL[name]
    system = build(0.0).assemble(guess=start)
    result = mbs.simulate.run(system, 0.5, q0=start, tolerance=1e-8)
    small = build(1e-6 if name == "rotation" else 1e-5).assemble()
    q0, v0 = (
        {row.name: float(result[f"{row.name}.{kind}"][0]) for row in rows}
        for rows, kind in ((system.coordinates, "q"), (system.velocity_coordinates, "v"))
    )
    options = {"q0": q0, "v0": v0, "tolerance": 1e-6, "method": "rodas"}
    other = mbs.simulate.run(small, 0.5, **options)
    for c in system.coordinates:
        np.testing.assert_allclose(result[f"{c.name}.q"], other[f"{c.name}.q"], atol=5e-5)


def test_what_dampers_take_is_what_the_energy_loses():
    system = arm(0.0).assemble(guess={"j": 0.5, "x": 0.12})
    options = {"v0": {"j": 1.0}, "tolerance": 1e-10, "step": 1e-3}
    result = mbs.simulate.run(system, 1.0, q0={"j": 0.5, "x": 0.12}, **options)
    energy = result["kinetic_energy"] + result["potential_energy"]
    power = 4 * result["n.v"] ** 2 + 2 * (result["x.v"] - result["n.v"]) ** 2
    lost = np.sum(power[:-1:2] + 4 * power[1::2] + power[2::2]) * 1e-3 / 3  # Simpson's rule
    assert lost > 1.0
    assert energy[0] - energy[-1] == pytest.approx(lost, rel=1e-6)


def test_slopes_of_a_moving_node():
    """The linear equations at a motion are the slopes of the accelerations."""
    system = arm(0.0).assemble(guess={"j": 0.5, "x": 0.12})
    names = [c.name for c in system.coordinates]
    q = np.array([{"j": 0.5, "n": 0.02, "x": 0.12}[name] for name in names])
    A = mbs.models.linearise(system).at(q0=q, v0={"j": 1.0, "x": 0.2}).A
    ddm = mbs.models.direct_dynamics(system)
    s = casadi.SX.sym("q", 3)
    slope = casadi.Function("slope", [s], [casadi.jacobian(ddm(s, [1.0, 0.2], [0, 0]), s)])
    order = [names.index(system.velocity_coordinates[k].name) for k in system.chosen_coordinates]
    np.testing.assert_allclose(A[3:, :3], slope(q).full()[:, order], atol=1e-9)


def test_a_push_on_a_damped_node_raises():
    system = element().assemble(guess={"x": 1.0})
    with pytest.raises(mbs.errors.ModelError, match="the motion acts on n, which moves no mass"):
        mbs.simulate.run(system, 0.1, motion={"n.q": 0.1})


# Dry friction with a damper: D v = f - limit sign(f), or v = 0 while |f| is below the limit.


def braked(*elements, friction=5.0, viscous=8.0, node=0.0, **joint):
    """A mass between two springs, one of which ends at a node with friction."""
    m = mbs.Mechanism("braked")
    body, knot = m.add(PointMass("body", mass=MASS)), m.add(PointMass("knot", mass=node))
    m.connect(m.world, Prismatic("x", axis="x"), body)
    m.connect(m.world, Prismatic("n", axis="x", Fv=viscous, **joint), knot)
    m.add(Spring("s", knot.at(), body.at(), stiffness=K, length=1.0))
    m.add(Spring("p", m.world.at(-1), body.at(), stiffness=200.0, length=2.0))
    if friction:
        m.add(CoulombFriction("f", joint="n", sliding=friction))
    for element in elements:
        m.add(element(m, knot, body))
    return m


def held(result, friction=5.0, viscous=8.0):
    """The velocity of the node by the law of friction."""
    force = K * (result["x.q"] - 1 - result["n.q"])
    return np.sign(force) * np.maximum(np.abs(force) - friction, 0) / viscous


def test_a_node_with_dry_and_viscous_friction(tmp_path):
    system = braked().assemble(guess={"x": 1.0})
    start = {"q0": {"x": 1.1}, "tolerance": 1e-9, "step": 1e-3}
    result = mbs.simulate.run(system, 1.0, **start)
    np.testing.assert_allclose(result["n.v"], held(result), atol=1e-8)
    assert (result["n.v"] == 0).sum() > 100
    assert np.ptp(result["n.q"]) > 0.1
    energy = result["kinetic_energy"] + result["potential_energy"]
    power = 8 * result["n.v"] ** 2 + 5 * np.abs(result["n.v"])
    lost = np.sum(power[:-1:2] + 4 * power[1::2] + power[2::2]) * 1e-3 / 3
    assert energy[0] - energy[-1] == pytest.approx(lost, rel=1e-4)
    rodas = mbs.simulate.run(system, 1.0, method="rodas", **start)
    np.testing.assert_allclose(rodas["n.q"], result["n.q"], atol=1e-6)
    path = mbs.export.fmu(system, tmp_path / "braked.fmu")
    for kind in ("CoSimulation", "ModelExchange"):
        options = {"start": {"x": 1.1}, "tolerance": 1e-9, "quiet": True}
        other = mbs.simulate.fmu(path, 1.0, kind=kind, **options)
        at = np.interp(other.time, result.time, result["n.q"])
        np.testing.assert_allclose(other["n.q"], at, atol=1e-5)


def test_a_node_moves_without_a_compiler_too(monkeypatch):
    """Equal to the compiled motion but for rounding."""
    system = braked().assemble(guess={"x": 1.0})
    found = []
    for compiler in (True, False):
        if not compiler:
            monkeypatch.setenv("CC", "")
            monkeypatch.setenv("PATH", "")
        for method in ("dopri5", "rodas"):
            options = {"q0": {"x": 1.1}, "method": method, "tolerance": 1e-9}
            found.append(mbs.simulate.run(system, 0.3, **options)["n.q"])
    for one, other in zip(found[:2], found[2:], strict=True):
        np.testing.assert_allclose(one, other, atol=1e-11)


def test_dry_friction_of_a_node_is_that_of_one_of_little_mass():
    result = mbs.simulate.run(braked().assemble(guess={"x": 1.0}), 1.0, q0={"x": 1.1})
    small = braked(node=1e-4).assemble()
    v0 = {"n": float(result["n.v"][0])}
    options = {"q0": {"x": 1.1}, "v0": v0, "tolerance": 1e-6, "method": "rodas"}
    other = mbs.simulate.run(small, 1.0, **options)
    for name in ("x.q", "n.q"):
        np.testing.assert_allclose(result[name], other[name], atol=2e-4)


REFUSED = {
    "friction alone": (
        (lambda m, knot, body: CoulombFriction("g", joint="n", sliding=1.0),),
        {"friction": 0, "viscous": 0},
        "CoulombFriction g, which needs viscous damping of the node alone.*SpringFrictionSeries",
    ),
    "sticking": (
        (lambda m, knot, body: CoulombFriction("g", joint="n", sliding=1.0, sticking=2.0),),
        {"friction": 0},
        "CoulombFriction g, which needs sticking = sliding.*or give the node a mass",
    ),
    "a damper to a mass": (
        (lambda m, knot, body: Damper("d", knot, body, damping=3.0),),
        {},
        "CoulombFriction f, which needs viscous damping of the node alone",
    ),
    "smooth friction": (
        (lambda m, knot, body: JointFriction("j", joint="n", coulomb=1.0),),
        {"friction": 0},
        "JointFriction j, which is not linear in velocities",
    ),
    "friction of the joint": ((), {"friction": 0, "Fs": 1.0}, "the friction Fs of n"),
    "a stop": (
        (lambda m, knot, body: RigidStop("r", joint="n", lower=-1.0),),
        {"friction": 0},
        "RigidStop r, which locks and releases a mass only: give the node a mass",
    ),
    "an input": (
        (lambda m, knot, body: ForceInput("push", knot.at()),),
        {"friction": 0},
        "ForceInput push, which has inputs or states",
    ),
    "a component with states": (
        (lambda m, k, b: SpringDamperSeries("e", m.world, k, stiffness=3.0, damping=1.0),),
        {"friction": 0},
        "SpringDamperSeries e, which has inputs or states",
    ),
    "a motor": ((), {"friction": 0, "actuated": True}, "or it has a motor"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_keeps_the_balance_from_giving_a_node_is_named(name):
    elements, options, text = REFUSED[name]
    system = braked(*elements, **options).assemble(guess={"x": 1.0})
    with pytest.raises(mbs.errors.MbsError, match=text):
        mbs.simulate.run(system, 0.1, q0={"x": 1.1}, quiet=True)


def test_a_node_without_springs_and_dampers_is_named():
    m = mbs.Mechanism("loose")
    body, knot = m.add(PointMass("body", mass=MASS)), m.add(PointMass("knot", mass=0))
    m.connect(m.world, Prismatic("x", axis="x", stiffness=1.0), body)
    m.connect(m.world, Prismatic("n", axis="x"), knot)
    with pytest.raises(mbs.errors.ModelError, match="no spring and no damper acts on n"):
        mbs.simulate.run(m.assemble(), 0.1)


def test_matrices_that_would_leave_out_the_drift_of_a_node_raise():
    system = arm(0.0).assemble(guess={"j": 0.5, "x": 0.12})
    J = mbs.models.jacobian(system, frame="tip")([0.5, 0.02, 0.12])
    assert J.shape == (6, 2)
    text = "does not give the velocity of n, which moves no mass"
    with pytest.raises(mbs.errors.ModelError, match=text):
        mbs.models.jacobian(system, frame="node")
    with pytest.raises(mbs.errors.ModelError, match=text):
        mbs.models.velocity_closure(system)
    assert mbs.models.jacobian(system, frame="node", coordinates="tree").size_out(0) == (6, 3)


def test_parameters_without_value_are_named():
    system = element(damping="c").assemble(guess={"x": 1.0})
    with pytest.raises(mbs.errors.SolverError, match=r"n moves no mass.* needs values of c"):
        mbs.simulate.run(system, 0.1, parameters={"c": 5.0}, q0={"x": 1.1})
