"""Nodes without mass between springs follow from the balance of forces."""

import pickle

import casadi
import numpy as np
import pytest

import mbs
from mbs.components import (
    Body,
    Cartesian,
    CoulombFriction,
    Custom,
    Damper,
    FixedFlange,
    ForceInput,
    PointMass,
    Prismatic,
    Revolute,
    ShaftInertia,
    ShaftSpringDamperSeries,
    Spring,
    SpringDamperSeries,
    WrenchSensor,
    custom,
)
from mbs.errors import ModelError, SolverError

K1, K2, MASS = 300.0, 600.0, 2.0
SERIES = K1 * K2 / (K1 + K2)


def chain(*elements, node=0.0, parameters=None):
    """A mass on two springs in series, with a node of no mass between them."""
    m = mbs.Mechanism("chain", parameters=parameters)
    knot, body = m.add(PointMass("node", mass=node)), m.add(PointMass("body", mass=MASS))
    m.connect(m.world, Prismatic("n", axis="x"), knot)
    m.connect(m.world, Prismatic("x", axis="x"), body)
    k1 = "K1" if parameters else K1
    m.add(Spring("s1", m.world.at(-1), knot.at(), stiffness=k1, length=1.0))
    m.add(Spring("s2", knot.at(), body.at(), stiffness=K2, length=1.0))
    for element in elements:
        m.add(element(m, knot))
    return m


def assembled(*elements, **given):
    return chain(*elements, **given).assemble(guess={"x": 1.0})


def test_springs_in_series_oscillate_as_one_spring():
    system = assembled()
    assert [system.velocity_coordinates[k].name for k in system.independent] == ["x"]
    assert "The balance of forces gives n, which move no mass" in system.report()
    result = mbs.simulate.run(system, 2.0, q0={"x": 1.1}, tolerance=1e-10)
    exact = 0.1 * np.cos(np.sqrt(SERIES / MASS) * result.time)
    np.testing.assert_allclose(result["x.q"], 1 + exact, atol=1e-10)
    np.testing.assert_allclose(result["n.q"], exact * K2 / (K1 + K2), atol=1e-10)
    assert np.ptp(result["kinetic_energy"] + result["potential_energy"]) < 1e-8


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_an_fmu_of_springs_in_series(kind, tmp_path):
    path = mbs.export.fmu(assembled(), tmp_path / "chain.fmu")
    result = mbs.simulate.fmu(path, 2.0, start={"x": 1.1}, kind=kind, tolerance=1e-9, quiet=True)
    exact = 1 + 0.1 * np.cos(np.sqrt(SERIES / MASS) * result.time)
    np.testing.assert_allclose(result["x.q"], exact, atol=1e-6)


def test_models_of_springs_in_series():
    system = assembled()
    q = mbs.loops.solve(system, {"x": 1.1})
    np.testing.assert_allclose(q, [0.1 * K2 / (K1 + K2), 1.1], atol=1e-13)
    a = mbs.models.direct_dynamics(system)(q, 0, 0)
    assert float(a) == pytest.approx(-SERIES * 0.1 / MASS)
    whole = mbs.models.direct_dynamics(system, coordinates="tree")(q, [0, 0], [0, 0])
    np.testing.assert_allclose(whole[0].full().ravel()[1], float(a))
    np.testing.assert_allclose(whole[1].full(), 0, atol=1e-12)  # no force through the row
    assert float(mbs.models.inverse_dynamics(system)(q, 0, 0)) == pytest.approx(SERIES * 0.1)
    A = mbs.models.linearise(system).at(q0={"x": 1.0}).A
    np.testing.assert_allclose(A, [[0, 1], [-SERIES / MASS, 0]], atol=1e-9)
    again = pickle.loads(pickle.dumps(system))
    assert float(mbs.models.direct_dynamics(again)(q, 0, 0)) == pytest.approx(float(a))


def test_a_stiffness_may_be_a_parameter():
    system = assembled(parameters={"K1": K1})
    result = mbs.simulate.run(system, 1.0, q0={"x": 1.1}, parameters={"K1": 100.0})
    w = np.sqrt(100 * K2 / (100 + K2) / MASS)
    np.testing.assert_allclose(result["x.q"], 1 + 0.1 * np.cos(w * result.time), atol=1e-7)


class Hardening(Custom):
    """A spring of force k x + c x^3 on a coordinate."""

    at = custom.coordinate()
    k = custom.parameter("N/m", 100.0)
    c = custom.parameter("N/m3", 5e4)

    def energy(self, at):
        return at.k * at.at.q**2 / 2 + at.c * at.at.q**4 / 4


def test_a_nonlinear_spring():
    """The force of the node's own spring is that of the spring to the mass."""
    m = mbs.Mechanism("hardening")
    knot, body = m.add(PointMass("node", mass=0)), m.add(PointMass("body", mass=MASS))
    m.connect(m.world, Prismatic("n", axis="x"), knot)
    m.connect(m.world, Prismatic("x", axis="x"), body)
    m.add(Hardening("h", at="n"))
    m.add(Spring("s2", knot.at(), body.at(), stiffness=K2, length=1.0))
    system = m.assemble(guess={"x": 1.0})
    result = mbs.simulate.run(system, 1.0, q0={"x": 1.2}, tolerance=1e-9)
    n, x = result["n.q"], result["x.q"] - 1
    assert n.max() > 0.05
    np.testing.assert_allclose(100 * n + 5e4 * n**3, K2 * (x - n), atol=1e-8)
    np.testing.assert_allclose(MASS * result["x.a"], -K2 * (x - n), atol=1e-7)
    assert np.ptp(result["kinetic_energy"] + result["potential_energy"]) < 1e-6


def knotted(mass):
    """Three springs from the ground to a knot, from which a mass hangs on a fourth one."""
    m = mbs.Mechanism("knotted", gravity=(0, -9.81, 0))
    knot, body = m.add(PointMass("knot", mass=mass)), m.add(PointMass("body", mass=1.5))
    m.connect(m.world, Cartesian("k"), knot)
    m.connect(m.world, Cartesian("b"), body)
    for k, place in enumerate([(-0.5, 0.3, 0.1), (0.6, 0.4, 0.0), (0.0, 0.5, -0.5)]):
        spring = Spring(f"s{k}", m.world.at(*place), knot.at(), stiffness=200 + 20 * k, length=0.3)
        m.add(spring)
    m.add(Spring("hang", knot.at(), body.at(), stiffness=150.0, length=0.4))
    return m


def test_a_knot_of_springs_in_space_is_as_one_of_little_mass():
    start = {"b.x": 0.1, "b.y": -0.6, "b.z": 0.05}
    system = knotted(0.0).assemble(guess=start)
    named = dict(zip((c.name for c in system.coordinates), system.configuration, strict=True))
    assert {name: named[name] for name in start} == pytest.approx(start, abs=1e-12)
    result = mbs.simulate.run(system, 1.0, tolerance=1e-8)
    small = knotted(1e-6).assemble()
    q0 = {c.name: float(result[f"{c.name}.q"][0]) for c in system.coordinates}
    other = mbs.simulate.run(small, 1.0, q0=q0, tolerance=1e-6, method="rodas")
    for c in system.coordinates:
        np.testing.assert_allclose(result[f"{c.name}.q"], other[f"{c.name}.q"], atol=2e-6)


def test_a_node_on_a_link_of_a_loop_keeps_its_guess():
    """Its spring balances the other one on either side of the point where it begins."""
    m = mbs.robots.four_bar()
    bar = next(iter(m.bodies()))
    node, tip = m.add(PointMass("node", mass=0)), m.add(PointMass("tip", mass=0.2))
    m.connect(bar, Prismatic("n", axis="x"), node)
    m.connect(bar, Prismatic("x", axis="x"), tip)
    m.add(Spring("s1", bar, node, stiffness=3000.0, length=0.1))
    m.add(Spring("s2", node, tip, stiffness=5000.0, length=0.1))
    system = m.assemble(guess={"n": 0.1, "x": 0.2})
    named = dict(zip((c.name for c in system.coordinates), system.configuration, strict=True))
    assert named["n"] == pytest.approx(0.1, abs=1e-9)
    result = mbs.simulate.run(system, 1.0, q0={"j1": 0.3, "x": 0.21}, tolerance=1e-9)
    n, x = result["n.q"], result["x.q"]
    np.testing.assert_allclose(3000 * (n - 0.1), 5000 * (x - n - 0.1), atol=1e-8)
    energy = result["kinetic_energy"] + result["potential_energy"]
    assert np.ptp(energy) < 1e-6 * result["kinetic_energy"].max()


def test_a_node_that_rotates():
    """Two torsion springs in series: a joint with a spring on a massless frame, then a pendulum."""
    m = mbs.Mechanism("shaft", gravity=(0, 0, 0))
    hub, body = m.add(PointMass("hub", mass=0)), m.add(PointMass("body", mass=1.0))
    m.connect(m.world, Revolute("a", axis="z", stiffness=2.0), hub)
    m.connect(hub, Revolute("b", axis="z", stiffness=4.0), body.at(-1))
    system = m.assemble()
    assert system.closure is None  # the hub carries the body: no coordinate is without inertia


def test_an_input_on_a_massless_node_raises():
    """The balance of forces would have to know it."""
    system = assembled(lambda m, knot: ForceInput("push", knot.at()))
    with pytest.raises(ModelError, match=r"n can move without .* needs springs"):
        mbs.simulate.run(system, 0.1, q0={"x": 1.1})


def test_friction_on_a_massless_node_raises():
    system = assembled(lambda m, knot: CoulombFriction("f", joint="n", sliding=1.0))
    assert system.closure is None
    with pytest.raises(SolverError):
        mbs.simulate.run(system, 0.1, q0={"x": 1.1})


def test_efforts_motions_and_wrenches_on_a_massless_node_raise(tmp_path):
    system, text = assembled(), "acts on n, which moves no mass.*give it a mass"
    with pytest.raises(ModelError, match=f"tau {text}"):
        mbs.simulate.run(system, 0.1, tau=lambda t, q, v: {"n": casadi.sin(t)})
    with pytest.raises(ModelError, match=r"n.*has no motor"):
        mbs.simulate.run(system, 0.1, tau={"n": 1.0})
    with pytest.raises(ModelError, match=f"the motion {text}"):
        mbs.simulate.run(system, 0.1, motion={"n.q": 0.1})
    with pytest.raises(ModelError, match=f"f_ext {text}"):
        mbs.models.inverse_dynamics(system, f_ext=True)
    with pytest.raises(ModelError, match=f"the wrench on node {text}"):
        mbs.export.fmu(system, tmp_path / "chain.fmu", inputs=["node.wrench"])
    assert mbs.simulate.run(system, 0.1, tau={"x": 1.0})["x.v"][-1] > 0


@pytest.mark.parametrize("kind", ["points", "shafts"])
def test_a_node_between_a_spring_and_a_damper_with_a_parallel_spring(kind):
    """The node moves as one of little mass; its velocity follows from the balance of forces."""
    k, c, K = 600.0, 20.0, 300.0
    m = mbs.Mechanism("solid")
    if kind == "points":
        body = m.add(PointMass("body", mass=MASS))
        m.connect(m.world, Prismatic("x", axis="x"), body)
        m.add(
            SpringDamperSeries("s", m.world, body, stiffness=k, damping=c, length=1.0, parallel=K)
        )
        start, state, offset = {"x": 1.1}, "s.elongation", 1.0
    else:
        wheel = ShaftInertia("x", MASS)
        solid = ShaftSpringDamperSeries("s", stiffness=k, damping=c, parallel=K)
        m.connect(solid.flange_a, wheel.flange_a)
        m.connect(solid.flange_b, FixedFlange("ground").flange)
        start, state, offset = {"x": 0.1}, "s.twist", 0.0
    result = mbs.simulate.run(m.assemble(), 2.0, q0=start, tolerance=1e-10)
    # m times acceleration of x = -k (x - z), c times rate of z = k (x - z) - K z, from rest
    A = np.array([[0, 1, 0], [-k / MASS, 0, k / MASS], [k / c, 0, -(k + K) / c]])
    eigenvalues, vectors = np.linalg.eig(A)
    weights = np.linalg.solve(vectors, [0.1, 0.0, 0.0])
    modes = weights * np.exp(np.outer(result.time, eigenvalues))
    exact = np.real(modes @ vectors.T)
    np.testing.assert_allclose(result["x.q"] - offset, exact[:, 0], atol=1e-8)
    np.testing.assert_allclose(result[state], exact[:, 2], atol=1e-8)


def test_mechanisms_without_any_mass_stay_open():
    m = mbs.Mechanism("frames")
    m.connect(m.world, Prismatic("n", axis="x", stiffness=10.0), m.add(PointMass("node", mass=0)))
    assert m.assemble().closure is None


def test_friction_on_a_node_is_one_error():
    m = mbs.Mechanism("slip", gravity=(0, 0, 0))
    node, body = m.add(PointMass("node", mass=0)), m.add(PointMass("body", mass=2))
    m.connect(m.world, Prismatic("n", axis="x"), node)
    m.connect(m.world, Prismatic("x", axis="x"), body)
    m.add(Spring("s", node, body, stiffness=600, length=1))
    m.add(CoulombFriction("f", "n", sliding=3.0))
    with pytest.raises(SolverError, match=r"n can move without moving any inertia.*needs springs"):
        mbs.simulate.run(m.assemble(guess={"x": 1.0}), 0.1, q0={"x": 1.05}, quiet=True)


def with_inertia(*joints):
    """A mass on a spring that ends at a part with moments of inertia and no mass."""
    m = mbs.Mechanism("inertia", gravity=(0, 0, 0))
    node, body = m.add(Body("node", mass=0, inertia=(0.1, 0.1, 0.1))), m.add(PointMass("body", 2.0))
    place = m.world
    for joint in joints[:-1]:
        m.connect(place, joint, between := m.add(PointMass(f"at_{joint.name}", mass=0)))
        place = between
    m.connect(place, joints[-1], node)
    m.connect(m.world, Prismatic("x", axis="x"), body)
    m.add(Spring("s1", m.world.at(-1), node.at(), stiffness=K1, length=1.0))
    m.add(Spring("s2", node.at(), body.at(), stiffness=K2, length=1.0))
    return m.assemble(guess={"x": 1.0})


@pytest.mark.parametrize("turns", [False, True])
def test_moments_of_inertia_do_not_resist_displacements(turns):
    """A node on a slide has no inertia along it; the angle behind it keeps its own."""
    joints = [Prismatic("n", axis="x"), *([Revolute("r", axis="x")] if turns else [])]
    system = with_inertia(*joints)
    assert [system.velocity_coordinates[k].name for k in system.independent] == ["r", "x"][
        not turns :
    ]
    v0 = {"r": 0.5} if turns else None
    result = mbs.simulate.run(system, 1.0, q0={"x": 1.1}, v0=v0, tolerance=1e-10)
    exact = 0.1 * np.cos(np.sqrt(SERIES / MASS) * result.time)
    np.testing.assert_allclose(result["x.q"], 1 + exact, atol=1e-9)
    np.testing.assert_allclose(result["n.q"], exact * K2 / (K1 + K2), atol=1e-9)
    if turns:
        np.testing.assert_allclose(result["r.q"], 0.5 * result.time, atol=1e-9)


def structure(*elements):
    """A triangle of bars that cannot move, a node on a slide, and a sensor at a foot."""
    m = mbs.Mechanism("structure", gravity=(0, -9.81, 0))
    own = {"mass": 1.0, "com": (0.25, 0, 0), "inertia": (0.1, 0.1, 0.1)}
    left, right = m.add(Body("left", **own)), m.add(Body("right", **own))
    m.connect(m.world, Revolute("a", axis="z"), left)
    m.connect(left.at(0.5), Revolute("c", axis="z"), right.at(0.5))
    m.connect(m.world.at(0.6), Revolute("b", axis="z"), right)
    knot = m.add(PointMass("knot", mass=0))
    m.connect(m.world, Prismatic("n", axis="x"), knot)
    m.add(WrenchSensor("foot", "a", axes="world"))
    for element in elements:
        m.add(element(m, left, knot))
    guess = {"a": np.arccos(0.6), "b": np.pi - np.arccos(0.6)}
    return m.assemble(guess=guess)


BETWEEN = (
    lambda m, left, knot: Spring("s1", m.world.at(-1), knot, stiffness=300, length=0.8),
    lambda m, left, knot: Spring("s2", knot, left.at(0.5), stiffness=100, length=0.1),
)


def damper(m, left, knot):
    return Damper("d", m.world.at(-1), knot, damping=20.0)


@pytest.mark.parametrize("method", ["dopri5", "rodas"])
def test_a_node_of_a_structure_rests_where_its_springs_balance(method):
    system = structure(*BETWEEN)
    assert system.closure.independent == ()
    result = mbs.simulate.run(system, 0.1, method=method, tolerance=1e-9)
    n = result["n.q"]
    assert np.ptp(n) < 1e-12
    first = 300 * (n[0] + 0.2)
    stretched = np.hypot(0.3 - n[0], 0.4)
    assert first == pytest.approx(100 * (stretched - 0.1) * (0.3 - n[0]) / stretched)
    assert result["s1.force"][-1] == pytest.approx(first)
    # the wrench at the foot is that of one spring in the place of both
    alone = structure(
        BETWEEN[0],
        lambda m, left, knot: Spring(
            "pull", m.world.at(n[0]), left.at(0.5), stiffness=100, length=0.1
        ),
    )
    other = mbs.simulate.run(alone, 0.1, method=method, tolerance=1e-9)
    np.testing.assert_allclose(result["foot.f.x"], other["foot.f.x"], rtol=1e-9)


def test_a_damped_node_of_a_structure_creeps():
    """Nothing else moves: the rate is that of the spring over the damping."""
    system = structure(BETWEEN[0], damper)
    assert system.closure.independent == ()
    for method in ("dopri5", "rodas"):
        result = mbs.simulate.run(system, 1.0, q0={"n": 0.3}, method=method, tolerance=1e-9)
        exact = -0.2 + 0.5 * np.exp(-15 * result.time)
        np.testing.assert_allclose(result["n.q"], exact, atol=1e-8)
        assert np.ptp(result["foot.f.y"]) < 1e-9
    np.testing.assert_allclose(mbs.models.linearise(system).at().A, [[-15]], atol=1e-9)


def test_an_fmu_of_a_structure_with_a_damped_node(tmp_path):
    path = mbs.export.fmu(structure(BETWEEN[0], damper), tmp_path / "structure.fmu")
    for kind in ("CoSimulation", "ModelExchange"):
        options = {"start": {"n": 0.3}, "kind": kind, "tolerance": 1e-8, "quiet": True}
        result = mbs.simulate.fmu(path, 1.0, **options)
        exact = -0.2 + 0.5 * np.exp(-15 * result.time)
        np.testing.assert_allclose(result["n.q"], exact, atol=1e-6)


@pytest.mark.parametrize("q0", [{"n": 0.2, "x": 1.1}, [0.2, 1.1]])
def test_a_position_of_a_node_out_of_balance_names_the_node(q0):
    with pytest.raises(mbs.errors.LoopError, match=r"forces on n, .* at n = 0.2; leave n out"):
        mbs.simulate.run(assembled(), 0.01, q0=q0, quiet=True)
