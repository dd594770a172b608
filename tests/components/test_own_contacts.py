"""Dry friction, rigid stops and freewheels of components of one's own, against hand formulas."""

import importlib

import casadi
import numpy as np
import pytest
from support.contact_mechanisms import five_bar, four_bar
from support.messages import refused

import mbs
from mbs.components import (
    Body,
    Box,
    CoulombFriction,
    Custom,
    Free,
    Planar,
    PointMass,
    Prismatic,
    Revolute,
    RigidStop,
    WrenchSensor,
    custom,
)
from mbs.errors import AssemblyError, ModelError

G = 9.81


class OwnFriction(Custom):
    """Coulomb friction of a coordinate, as a user writes it."""

    joint = custom.coordinate()
    sliding = custom.parameter("N")
    sticking = custom.parameter("N", None)

    def frictions(self, at):
        return {"dry": custom.Friction(at.joint.v, at.sliding, at.sticking)}


class OwnStop(Custom):
    """A stop of a coordinate, as a user writes it."""

    joint = custom.coordinate()
    lower = custom.parameter("m", None)
    upper = custom.parameter("m", None)
    e = custom.parameter("1", 0.0)

    def stops(self, at):
        return {"end": custom.Stop(at.joint.q, at.lower, at.upper, restitution=at.e)}


class Rope(Custom):
    """A rope around a rough bar: it rubs where one coordinate moves by twice the other."""

    a = custom.coordinate()
    b = custom.coordinate()
    limit = custom.parameter("N", min=0)

    def frictions(self, at):
        return {"rub": custom.Friction(at.a.v + 2 * at.b.v, at.limit)}


class Belt(Custom):
    """A body on a belt that runs at a speed, pressed by a force that is an input."""

    joint = custom.coordinate()
    speed = custom.parameter("m/s")
    mu = custom.parameter(min=0)
    press = custom.input("N")

    def frictions(self, at):
        limit = at.mu * casadi.fmax(at.press, 0)
        return {"grip": custom.Friction(at.joint.v - at.speed, limit, 1.5 * limit)}


class Wall(Custom):
    """A circle that a point stays inside of, without friction."""

    centre = custom.frame()
    point = custom.frame()
    radius = custom.parameter("m", positive=True)
    e = custom.parameter("1", 0.0, min=0, max=1)

    def stops(self, at):
        distance = at.centre.to(at.point).length
        return {"wall": custom.Stop(at.radius - distance, restitution=at.e)}


class Rub(Custom):
    """A brake shoe: a point of a body rubs on the ground along x of the world."""

    point = custom.frame()
    limit = custom.parameter("N", min=0)

    def frictions(self, at):
        return {"shoe": custom.Friction(at.point.v[0], at.limit)}


def rail(*elements, gravity=(0, 0, 0), masses=(2.0, 3.0)):
    """Two bodies on one rail."""
    m = mbs.Mechanism("rail", gravity=gravity)
    for name, mass in zip(("x", "y"), masses, strict=True):
        m.connect(m.world, Prismatic(name, axis="x"), m.add(PointMass(f"m_{name}", mass)))
    for element in elements:
        m.add(element)
    return m.assemble()


def table(*elements, gravity=(0, 0, 0), at=None):
    """A point mass that moves in the plane of x and y."""
    m = mbs.Mechanism("table", gravity=gravity)
    cross, ball = m.add(Body("cross", mass=0)), m.add(PointMass("ball", 0.7))
    m.connect(m.world, Prismatic("x", axis="x"), cross)
    m.connect(cross, Prismatic("y", axis="y"), ball)
    for make in elements:
        m.add(make(m, ball))
    return m.assemble(**({} if at is None else {"guess": at}))


def run(system, duration, **options):
    return mbs.simulate.run(system, duration, quiet=True, **{"tolerance": 1e-10, **options})


def test_friction_and_a_stop_of_ones_own_are_those_of_the_package():
    gravity = (1.5, 0, 0)
    ours = rail(
        CoulombFriction("dry", joint="x", sliding=1.0, sticking=2.0),
        RigidStop("end", joint="x", upper=0.6, restitution=0.5),
        gravity=gravity,
    )
    own = rail(
        OwnFriction("dry", "x", sliding=1.0, sticking=2.0),
        OwnStop("end", "x", upper=0.6, e=0.5),
        gravity=gravity,
    )
    one, other = (run(system, 3.0) for system in (ours, own))
    assert len(one.events) > 4
    assert [t for t, *_ in one.events] == [t for t, *_ in other.events]
    for name in ("x.q", "x.v", "x.a"):
        assert np.array_equal(one[name], other[name])
    assert np.array_equal(one["dry.effort"], other["dry.dry.effort"])
    assert np.array_equal(one["end.mode"], other["end.end.mode"])
    assert ("end", "end bounces off upper") in [event[1:] for event in other.events]


def two_on_a_rope(limit=5.0, force=0.0):
    return rail(Rope("rope", "x", "y", limit=limit), gravity=(force, 0, 0))


def test_friction_on_a_sum_of_two_coordinates_stops_it_and_then_holds_it():
    # w = x' + 2 y'; friction F along it gives w' = -F (1/2 + 4/3), and x' and y' their shares
    system, inverse = two_on_a_rope(), 1 / 2 + 4 / 3
    result = run(system, 2.0, v0={"x": 3.0, "y": 1.0})
    stops = 5.0 / (5.0 * inverse)
    ((time, *what),) = result.events
    assert what == ["rope", "rub sticks"]
    assert time == pytest.approx(stops, abs=1e-9)
    t = np.minimum(result.time, stops)
    np.testing.assert_allclose(result["x.v"], 3 - 5 / 2 * t, atol=1e-9)
    np.testing.assert_allclose(result["y.v"], 1 - 10 / 3 * t, atol=1e-9)
    w = (result["x.v"] + 2 * result["y.v"])[result.time > stops]
    assert np.abs(w).max() < 1e-12
    assert result.units["rope.rub.effort"] == "N"


@pytest.mark.parametrize(("force", "slides"), [(1.0, False), (4.0, True)])
def test_friction_on_two_coordinates_holds_up_to_its_limit(force, slides):
    # gravity g pulls both: held, F (1/2 + 4/3) = g (1 + 2)
    result = run(two_on_a_rope(force=force), 1.0)
    needed = -3 * force / (1 / 2 + 4 / 3)
    if slides:
        np.testing.assert_allclose(result["rope.rub.effort"], -5.0, atol=1e-12)
        np.testing.assert_allclose(result["x.a"], force - 5 / 2, atol=1e-12)
    else:
        np.testing.assert_allclose(result["rope.rub.effort"], needed, atol=1e-10)
        assert np.abs(result["x.v"] + 2 * result["y.v"]).max() < 1e-12
        np.testing.assert_allclose(result["x.a"], force + needed / 2, atol=1e-10)


class OwnSpring(Custom):
    """A spring from the ground to a coordinate."""

    joint = custom.coordinate()
    k = custom.parameter("N/m")

    def energy(self, at):
        return at.k * at.joint.q**2 / 2


def on_a_belt():
    return rail(Belt("belt", "x", speed=0.5, mu=0.3), OwnSpring("spring", "x", k=50.0))


def test_a_body_on_a_belt_sticks_and_slips():
    press, speed, w = 20.0, 0.5, np.sqrt(50 / 2)
    result = run(on_a_belt(), 6.0, v0={"x": speed}, u={"belt.press": press}, step=0.002)
    # carried until the spring pulls with the largest friction, at x_s; then it swings about x_d,
    # until its speed is that of the belt again
    x_d, x_s = 0.3 * press / 50, 1.5 * 0.3 * press / 50
    slips = 2 * (np.pi - np.arctan((x_s - x_d) * w / speed)) / w
    carried = 2 * (x_s - x_d) / speed
    times, what = [t for t, *_ in result.events], [done for *_, done in result.events]
    assert what[:4] == ["grip slides", "grip sticks"] * 2
    expected = np.cumsum([x_s / speed, slips, carried, slips])
    np.testing.assert_allclose(times[:4], expected, atol=1e-7)
    sticks = result["belt.grip.mode"] == 0
    assert 0 < sticks.sum() < len(sticks)
    assert np.abs(result["x.v"] - speed)[sticks].max() < 1e-12


def test_a_limit_that_follows_an_input_lets_go():
    system = rail(Belt("belt", "x", speed=0.0, mu=0.5), gravity=(2.0, 0, 0))
    result = run(system, 1.5, u=lambda t, q, v: [10 * (1 - t) ** 2], step=0.01)
    # it holds 4 N up to 1.5 mu N = 7.5 (1 - t)^2; then v' = 2 - 2.5 (1 - t)^2
    lets_go = 1 - np.sqrt(4 / 7.5)
    assert result.events == ((pytest.approx(lets_go, abs=1e-8), "belt", "grip slides"),)
    t = np.maximum(result.time, lets_go)
    v = 2 * (t - lets_go) + 2.5 / 3 * ((1 - t) ** 3 - (1 - lets_go) ** 3)
    np.testing.assert_allclose(result["x.v"], v, atol=1e-9)


def test_a_point_inside_a_circle_bounces_off_its_wall():
    def wall(m, ball):
        return Wall("pot", m.world.at(0.1, 0.2, 0), ball, radius=0.5, e=0.6)

    system = table(wall)
    result = run(system, 1.2, q0={"x": 0.1, "y": 0.2}, v0={"x": 0.8, "y": 0.6}, step=0.01)
    # along a radius: to and fro, the speed 0.6 times as large after each impact
    expected = np.cumsum([0.5, 1.0 / 0.6])
    times = [t for t, *_ in result.events]
    np.testing.assert_allclose(times, expected[: len(times)], atol=1e-9)
    assert result.events[0][1:] == ("pot", "wall bounces off lower")
    np.testing.assert_allclose([result["x.v"][-1], result["y.v"][-1]], [-0.48, -0.36], atol=1e-9)


def test_a_point_slides_along_a_circle_that_holds_it():
    def wall(m, ball):
        return Wall("pot", m.world, ball, radius=0.5)

    system = table(wall, gravity=(0, -G, 0))
    start, speed = {"x": 0.5 * np.sin(1.0), "y": -0.5 * np.cos(1.0)}, {}
    result = run(system, 2.0, q0=start, v0=speed, step=0.005)
    radius = np.hypot(result["x.q"], result["y.q"])
    assert np.abs(radius - 0.5).max() < 1e-12
    assert np.ptp(result["kinetic_energy"] + result["potential_energy"]) < 1e-8
    # the wall bears what a pendulum's rod does: m (g cos + v^2 / r)
    angle = np.arctan2(result["x.q"], -result["y.q"])
    v2 = result["x.v"] ** 2 + result["y.v"] ** 2
    np.testing.assert_allclose(
        result["pot.wall.effort"], 0.7 * (G * np.cos(angle) + v2 / 0.5), atol=1e-8
    )


def test_a_point_leaves_a_circle_that_no_longer_presses_it():
    system = table(lambda m, ball: Wall("pot", m.world, ball, radius=0.5), gravity=(0, -G, 0))
    v = np.sqrt(3.5 * G * 0.5)  # at the bottom: leaves where cos = -(v^2 / g r - 2) / 3
    result = run(system, 0.6, q0={"x": 0.0, "y": -0.5}, v0={"x": v}, step=0.001)
    leaves = next(t for t, _, what in result.events if what == "wall leaves lower")
    k = np.searchsorted(result.time, leaves)
    height = np.interp(leaves, result.time, result["y.q"])
    assert height == pytest.approx(0.5 * 0.5, abs=1e-5)  # rows are 1 ms apart
    assert result["pot.wall.effort"][k + 2] == 0


def pendulum():
    """A bar on a revolute joint whose end rubs on the ground."""
    m = mbs.Mechanism("pendulum", gravity=(0, 0, -G))
    bar = m.add(Body("bar", mass=1.2, com=(0, 0, -0.3), inertia=(0.05, 0.05, 0)))
    m.connect(m.world, Revolute("j", axis="y"), bar)
    m.add(Rub("rub", bar.at(0, 0, -0.6), limit=2.0))
    return m.assemble()


def test_a_point_that_rubs_brakes_a_pendulum_by_its_lever():
    system = pendulum()
    result = run(system, 1.5, q0={"j": 1.2}, step=0.002)
    q, v = result["j.q"], result["j.v"]
    # velocity of the point along x: -0.6 cos q times j's
    w = -0.6 * np.cos(q) * v
    heat = np.concatenate(
        [[0], np.cumsum(2.0 * np.diff(result.time) * (np.abs(w[1:]) + np.abs(w[:-1])) / 2)]
    )
    energy = result["kinetic_energy"] + result["potential_energy"]
    np.testing.assert_allclose(energy, energy[0] - heat, atol=1e-4)  # trapezoids of 2 ms
    held = run(system, 1.0, q0={"j": 0.1})
    assert np.abs(held["j.v"]).max() < 1e-12
    effort = 1.2 * G * 0.3 * np.sin(0.1) / (0.6 * np.cos(0.1))
    np.testing.assert_allclose(np.abs(held["rub.shoe.effort"]), effort, rtol=1e-9)


class Doubled(Custom):
    """Friction and stops on twice a coordinate, which are those of the coordinate."""

    joint = custom.coordinate()
    sliding = custom.parameter("N.m", None)
    lower = custom.parameter("rad", None)
    upper = custom.parameter("rad", None)
    e = custom.parameter("1", 0.0)

    def frictions(self, at):
        if at.sliding is None:
            return {}
        return {"dry": custom.Friction(2 * at.joint.v, at.sliding / 2)}

    def stops(self, at):
        if at.lower is None and at.upper is None:
            return {}
        low, high = (None if x is None else 2 * x for x in (at.lower, at.upper))
        return {"end": custom.Stop(2 * at.joint.q, low, high, at.e, 2e-4)}


LOOPS = {
    "rocker": (
        lambda *parts: four_bar(-G, *parts),
        (RigidStop("end", "b1", upper=2.2, restitution=0.4),),
        (Doubled("end", "b1", upper=2.2, e=0.4),),
    ),
    "crank": (
        lambda *parts: four_bar(-G, *parts),
        (CoulombFriction("end", "a1", sliding=3.0),),
        (Doubled("end", "a1", sliding=3.0),),
    ),
    "five": (
        lambda *parts: five_bar(-G, *parts),
        (RigidStop("low", "a2", lower=-1.6), CoulombFriction("dry", "b2", sliding=1.0)),
        (Doubled("low", "a2", lower=-1.6), Doubled("dry", "b2", sliding=1.0)),
    ),
}


@pytest.mark.parametrize("name", LOOPS)
def test_rows_in_closed_loops_do_what_those_of_coordinates_do(name):
    build, ours, own = LOOPS[name]
    one, other = (run(build(*parts), 1.5, step=0.005) for parts in (ours, own))
    kinds = [what for *_, what in one.events]
    assert kinds
    assert [t for t, *_ in other.events] == pytest.approx([t for t, *_ in one.events], abs=1e-7)
    assert [what.split()[-1] for *_, what in other.events] == [what.split()[-1] for what in kinds]
    for column in (c for c in one.units if c.endswith((".q", ".v"))):
        np.testing.assert_allclose(other[column], one[column], atol=1e-7)


@pytest.mark.parametrize("lever", [1e5, 1.0, 1e-2, 1e-5])
def test_a_lever_of_any_length_holds(lever):
    class Small(Custom):
        joint = custom.coordinate()

        def frictions(self, at):
            return {"dry": custom.Friction(lever * at.joint.v, 5.0 / lever)}

    result = run(rail(Small("small", "x"), gravity=(2.0, 0, 0)), 1.0)
    assert np.abs(result["x.v"]).max() < 1e-12
    np.testing.assert_allclose(lever * result["small.dry.effort"], -4.0, rtol=1e-12)


def test_friction_and_stops_without_a_compiler(monkeypatch):
    system = LOOPS["five"][0](*LOOPS["five"][2])
    compiled = run(system, 0.7, step=0.05)
    solvers = importlib.import_module("mbs.solvers._integrate")
    monkeypatch.setattr(solvers, "compiler_found", lambda: False)
    interpreted = run(five_bar(-G, *LOOPS["five"][2]), 0.7, step=0.05)
    assert len(interpreted.events) == len(compiled.events) > 2
    # two orders of the same sums
    assert np.abs(interpreted["b1.q"] - compiled["b1.q"]).max() < 1e-9


class Corner(Custom):
    """A point stays above the ground, without friction."""

    point = custom.frame()
    e = custom.parameter("1", 0.0, min=0, max=1)

    def stops(self, at):
        return {"floor": custom.Stop(at.point.p[2], restitution=at.e)}


def box(e, corners):
    """A free body with corners."""
    m = mbs.Mechanism("box", gravity=(0, 0, -G))
    body = m.add(Body("body", mass=2.0, inertia=(0.02, 0.03, 0.04)))
    m.connect(m.world, Free("f"), body)
    for k, (x, y) in enumerate(corners):
        m.add(Corner(f"c{k}", body.at(0.2 * x, 0.1 * y, -0.1), e=e))
    return m.assemble(guess={"f.z": 0.3})


def test_a_free_box_falls_on_its_four_corners_and_rests():
    system = box(0.0, ((1, 1), (1, -1), (-1, 1), (-1, -1)))
    result = run(system, 0.6)
    assert [what for *_, what in result.events] == ["floor rests at lower"] * 4
    assert result.events[0][0] == pytest.approx(np.sqrt(2 * 0.2 / G), abs=1e-9)
    assert result["f.z.q"][-1] == pytest.approx(0.1, abs=1e-12)
    efforts = [result[f"c{k}.floor.effort"][-1] for k in range(4)]
    # rows that depend on others share about alike; rigid bodies determine no shares
    assert sum(efforts) == pytest.approx(2.0 * G, rel=1e-12)
    np.testing.assert_allclose(efforts, 2.0 * G / 4, rtol=1e-2)


def test_a_free_body_bounces_on_one_corner_without_loss(tmp_path):
    system = box(1.0, ((1, 1),))
    v0 = {"f.wx": 1.0}
    result = run(system, 1.0, v0=v0)
    assert len(result.events) > 2
    assert np.ptp(result["kinetic_energy"] + result["potential_energy"]) < 1e-8
    path = mbs.export.fmu(system, tmp_path / "box.fmu")
    start = {"f.wx.v": 1.0}
    there = mbs.simulate.fmu(path, 1.0, start=start, tolerance=1e-10, quiet=True)
    assert abs(there["f.z.q"][-1] - result["f.z.q"][-1]) < 1e-7


def test_friction_that_falls_with_the_speed_takes_its_heat():
    class Stribeck(Custom):
        joint = custom.coordinate()
        heat = custom.state("J")

        def limit(self, at):
            return 2.0 + 3.0 * casadi.exp(-((at.joint.v / 0.2) ** 2))

        def frictions(self, at):
            return {"dry": custom.Friction(at.joint.v, self.limit(at))}

        def rates(self, at):
            return {"heat": self.limit(at) * casadi.fabs(at.joint.v)}

    system = rail(Stribeck("dry", "x"), OwnSpring("spring", "x", k=50.0))
    result = run(system, 3.0, q0={"x": 0.4}, step=0.002)
    assert result.events[-1][1:] == ("dry", "dry sticks")
    energy = result["kinetic_energy"] + result["potential_energy"] + result["dry.heat"]
    np.testing.assert_allclose(energy, 4.0, atol=1e-8)
    assert abs(50.0 * result["x.q"][-1]) < 5.0
    assert np.abs(result["x.v"][result["dry.dry.mode"] == 0]).max() < 1e-12
    # 4.9 N do not move it, 5.1 N do
    for x, moves in ((0.098, False), (0.102, True)):
        again = run(system, 0.1, q0={"x": x})
        assert (np.abs(again["x.v"]).max() > 1e-3) == moves


class Line(Custom):
    """Two points rub where their distance changes; the heat is a state."""

    a = custom.frame()
    b = custom.frame()
    limit = custom.parameter("N")
    heat = custom.state("J")

    def frictions(self, at):
        return {"rub": custom.Friction(at.a.to(at.b).rate, at.limit)}

    def rates(self, at):
        return {"heat": at.limit * casadi.fabs(at.a.to(at.b).rate)}


def rubbed_loop():
    """A four-bar whose coupler rubs on the ground."""
    m = mbs.Mechanism("rubbed", gravity=(0, -G, 0))
    lengths = {"a": 0.3, "b": 0.8, "c": 0.7}
    a, b, c = (m.add(Box(name, length=x, mass=1.0)) for name, x in lengths.items())
    m.connect(m.world, Revolute("j1", axis="z"), a.left)
    m.connect(a.right, Revolute("j2", axis="z", actuated=False), b.left)
    m.connect(b.right, Revolute("j3", axis="z", actuated=False), c.right)
    m.connect(m.world.at(0.9, 0, 0), Revolute("j4", axis="z", actuated=False), c.left)
    m.add(Line("line", m.world.at(0.2, -0.5, 0), b.at(0.1, 0.1, 0), limit=1.5))
    return m.assemble(guess={"j1": 1.0, "j2": -0.5}, active=("j1",))


def test_friction_between_points_of_a_closed_loop_takes_what_its_slip_says():
    result = run(rubbed_loop(), 2.0, v0={"j1": 4.0}, step=0.005)
    assert [what for *_, what in result.events] == ["rub slides"] * len(result.events)
    assert len(result.events) > 3
    total = result["kinetic_energy"] + result["potential_energy"] + result["line.heat"]
    assert result["line.heat"][-1] > 1.0
    assert np.ptp(total) < 1e-8  # J


class Shoe(Rub):
    """The brake shoe, with its heat."""

    heat = custom.state("J")

    def rates(self, at):
        return {"heat": at.limit * casadi.fabs(at.point.v[0])}


@pytest.mark.parametrize("tolerance", [1e-6, 1e-10])
def test_a_lever_that_vanishes_on_the_way_turns_the_friction_round(tolerance):
    m = mbs.Mechanism("pendulum", gravity=(0, 0, -G))
    bar = m.add(Body("bar", mass=1.2, com=(0, 0, -0.3), inertia=(0.05, 0.05, 0)))
    m.connect(m.world, Revolute("j", axis="y"), bar)
    m.add(Shoe("shoe", bar.at(0, 0, -0.6), limit=0.3))
    result = run(m.assemble(), 4.0, v0={"j": 12.0}, tolerance=tolerance)
    assert result["j.q"][-1] > 6 * np.pi  # past +-90 degrees, where the point moves across x
    total = result["kinetic_energy"] + result["potential_energy"] + result["shoe.heat"]
    assert np.ptp(total) < 10 * tolerance


@pytest.mark.parametrize("tolerance", [1e-6, 1e-10])
def test_a_point_rubs_where_a_loop_passes_singular_configurations(tolerance):
    """All bars lie on one line twice a revolution; levers vanish twice as well."""
    m = mbs.load("n_four_bar")
    bodies = list(m.bodies())
    m.add(Shoe("shoe", bodies[1].at(0.05, 0.02, 0), limit=0.3))
    result = run(m.assemble(), 5.0, v0={"a0": 4.0}, tolerance=tolerance)
    assert result["a0.q"][-1] > 8 * np.pi
    total = result["kinetic_energy"] + result["potential_energy"] + result["shoe.heat"]
    # of 40 J; what is passed is projected
    assert np.ptp(total) < 10 * max(tolerance, 1e-8)


class Edge(Custom):
    """A point slides along the x axis of its frame alone."""

    point = custom.frame()

    def velocity_rows(self, at):
        return {"side": casadi.dot(at.point.R[:, 1], at.point.v)}


def test_an_fmu_has_stops_beside_rows_that_bind_velocities_alone(tmp_path):
    m = mbs.Mechanism("sled", gravity=(0, 0, -G))
    body = m.add(Body("body", mass=1.0, com=(0.1, 0, 0), inertia=(0.1, 0.1, 0.1)))
    m.connect(m.world, Planar("p", actuated=False), body)
    m.add(Edge("edge", body))
    m.add(CoulombFriction("dry", "p.phi", sliding=0.1))
    system = m.assemble()
    v0 = {"p.s_x": 1.0, "p.phi": 0.5}
    here = run(system, 2.0, v0=v0)
    assert [what for *_, what in here.events] == ["sticks"]
    path = mbs.export.fmu(system, tmp_path / "sled.fmu")
    start = {f"{name}.v": value for name, value in v0.items()}
    there = mbs.simulate.fmu(path, 2.0, start=start, tolerance=1e-10, quiet=True)
    for name in ("p.s_x.q", "p.s_y.q", "p.phi.q"):
        assert abs(there[name][-1] - here[name][-1]) < 1e-7


def test_where_drives_move_what_slips():
    class Grip(Custom):
        a = custom.coordinate()
        b = custom.coordinate()

        def frictions(self, at):
            return {"grip": custom.Friction(at.b.v - at.a.v, 6.0)}

    system = rail(Grip("grip", "x", "y"))  # y is 3 kg: it follows up to 2 m/s2
    follows = run(system, 2.0, motion={"x.a": lambda t: 1.0})
    np.testing.assert_allclose(follows["y.a"], 1.0, atol=1e-12)
    np.testing.assert_allclose(follows["x.tau"], 2.0 + 3.0, atol=1e-12)
    slips = run(system, 2.0, motion={"x.a": lambda t: 3.0})
    assert slips.events == ((0.0, "grip", "grip slides"),)
    np.testing.assert_allclose(slips["y.a"], 2.0, atol=1e-12)
    refused(
        ModelError,
        "the motions that are prescribed move grip.grip, on which",
        by=lambda: run(system, 1.0, motion={"x.a": 0.0, "y.a": 0.0}),
    )


def test_a_point_that_rubs_and_a_sensor_of_joint_forces_are_refused_together():
    m = mbs.Mechanism("pendulum", gravity=(0, 0, -G))
    bar = m.add(Body("bar", mass=1.2, com=(0, 0, -0.3), inertia=(0.05, 0.05, 0)))
    m.connect(m.world, Revolute("j", axis="y"), bar)
    m.add(Rub("rub", bar.at(0, 0, -0.6), limit=2.0))
    m.add(WrenchSensor("cut", "j"))
    told = "sensor cut reads the forces in a joint"
    refused(ModelError, told, "Rub rub", by=lambda: run(m.assemble(), 1.0))


def test_the_report_says_which_models_know_a_component():
    class Both(OwnFriction):
        def loads(self, at):
            return {"joint": -at.joint.q}

    lines = rail(OwnFriction("dry", "x", 1.0), Both("both", "y", 1.0)).report().splitlines()
    assert lines[-2:] == [
        "OwnFriction dry acts on x, in simulations; the other models leave it out.",
        "Both both acts on y; its frictions and stops in simulations, the other models leave them"
        " out.",
    ]


def test_what_has_no_events_yet_refuses_frictions_of_ones_own():
    system = rail(OwnFriction("dry", "x", 1.0))
    told = "dae has no events yet, which OwnFriction dry needs"
    refused(ModelError, told, by=lambda: mbs.models.dae(system))


def test_limits_of_ones_own_are_bounds():
    class Bounded(OwnStop):
        def limits(self, at):
            return {"joint": (at.lower, at.upper)}

    found = mbs.models.limits(rail(Bounded("end", "y", lower=-0.5, upper=2.0)))
    assert found.q_lower.tolist() == [-np.inf, -0.5]
    assert found.q_upper.tolist() == [np.inf, 2.0]
    for given, told in (
        ({"q": (0, 1)}, "limits names 'q', which is no coordinate"),
        ({"joint": 3.0}, "limits gives 3.0 for joint; give (lower, upper)"),
    ):
        kind = type("Mine", (OwnStop,), {"limits": lambda self, at, given=given: given})
        refused(AssemblyError, told, by=lambda kind=kind: rail(kind("end", "y", lower=-0.5)))


SLIP, GAP = (lambda at: at.joint.v), (lambda at: at.joint.q)


@pytest.mark.parametrize(
    ("method", "law", "told"),
    [
        ("frictions", lambda at: 1.0, "frictions gives 1.0 for 'one'; give custom.Friction"),
        ("stops", lambda at: custom.Friction(SLIP(at), 1), "stops gives a Friction for 'one'"),
        ("frictions", lambda at: custom.Friction(at.joint.q, 1), "does not depend on velocities"),
        ("frictions", lambda at: custom.Friction(at.joint.v**2, 1), "is not linear in velocities"),
        ("frictions", lambda at: custom.Friction(at.joint.v + at.joint.q, 1), "follows at rest"),
        (
            "frictions",
            lambda at: custom.Friction(SLIP(at) * at.u, 1),
            "depends on states or inputs",
        ),
        ("frictions", lambda at: custom.Friction(SLIP(at), at.u), "friction is a finite effort"),
        (
            "frictions",
            lambda at: custom.Friction(SLIP(at), casadi.inf),
            "the limit of 'one' is inf",
        ),
        ("frictions", lambda at: custom.Friction(SLIP(at), 2, 1), "sticking of 'one' is 1"),
        ("frictions", lambda at: custom.Friction(SLIP(at), 2, unit="W"), "the unit 'W'; use 'N'"),
        ("stops", lambda at: custom.Stop(at.joint.v), "the gap of 'one' depends on velocities"),
        ("stops", lambda at: custom.Stop(casadi.SX(1)), "does not depend on positions"),
        ("stops", lambda at: custom.Stop(GAP(at), None), "neither lower nor upper"),
        ("stops", lambda at: custom.Stop(GAP(at), restitution=1.5), "between 0 and 1"),
        ("stops", lambda at: custom.Stop(GAP(at), rest_speed=0), "rest_speed of 'one' is 0"),
        ("stops", lambda at: custom.Stop(GAP(at), 1.0, 0.5), "upper of 'one' is 0.5"),
        ("stops", lambda at: custom.Stop(GAP(at), at.joint.q), "depends on the motion"),
        ("stops", lambda at: custom.OneWay(at.joint.q), "the velocity of 'one' does not depend"),
        ("stops", lambda at: custom.Stop(at.joint.q * casadi.SX.sym("k")), "the symbol 'k'"),
    ],
)
def test_what_is_no_friction_or_stop_is_refused(method, law, told):
    used = {"loads": lambda self, at: {"joint": at.u}}
    fields = {"joint": custom.coordinate(), "u": custom.input(), **used}
    mine = type("Mine", (Custom,), {**fields, method: lambda self, at: {"one": law(at)}})
    refused(AssemblyError, "c (Mine)", told, by=lambda: rail(mine("c", "x")))


@pytest.mark.parametrize(("fmi", "kind"), [("2.0", "CoSimulation"), ("3.0", "ModelExchange")])
@pytest.mark.parametrize("name", ["rope", "pot", "pendulum", "rocker", "rubbed"])
def test_an_fmu_does_what_run_does(tmp_path, name, fmi, kind):
    duration, start = 1.2, {}
    if name == "rope":
        system, start = two_on_a_rope(force=-1.0), {"v0": {"x": 3.0, "y": 1.0}}
    elif name == "pot":
        system = table(
            lambda m, ball: Wall("pot", m.world, ball, radius=0.5, e=0.4), gravity=(0.3, -G, 0)
        )
    elif name == "rubbed":
        system, start = rubbed_loop(), {"v0": {"j1": 4.0}}
    elif name == "pendulum":
        system, start = pendulum(), {"q0": {"j": 1.2}}
    else:
        system = LOOPS["rocker"][0](*LOOPS["rocker"][2])
    here = run(system, duration, **start)
    assert here.events
    path = mbs.export.fmu(system, tmp_path / f"{name}.fmu", fmi=fmi)
    values = {f"{k}.q": v for k, v in start.get("q0", {}).items()}
    values |= {f"{k}.v": v for k, v in start.get("v0", {}).items()}
    there = mbs.simulate.fmu(
        path, duration, start=values, kind=kind, step=0.01, tolerance=1e-10, quiet=True
    )
    # Model Exchange is integrated by CVODE, whose errors add up over impacts
    allowed = 1e-7 if kind == "CoSimulation" else 1e-5
    shared = [c for c in here.units if c in there.units and c.endswith((".q", ".v", ".effort"))]
    assert any(c.endswith(".effort") for c in shared)
    compared = [
        k for k, t in enumerate(here.time) if all(abs(t - e) > 1e-6 for e, *_ in here.events)
    ]
    rows = [np.flatnonzero(np.abs(there.time - t) < 1e-9)[-1] for t in here.time[compared]]
    for column in shared:
        assert np.abs(there[column][rows] - here[column][compared]).max() < allowed, column
