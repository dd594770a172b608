"""Dry friction, rigid stops and freewheels of components of one's own, against hand formulas."""

import casadi
import numpy as np
import pytest
from support.contact_mechanisms import five_bar, four_bar

import mbs
from mbs.components import (
    Body,
    CoulombFriction,
    Custom,
    PointMass,
    Prismatic,
    Revolute,
    RigidStop,
    custom,
)

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
    cross, ball = m.add(Body("cross")), m.add(PointMass("ball", 0.7))
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


@pytest.mark.parametrize(("fmi", "kind"), [("2.0", "CoSimulation"), ("3.0", "ModelExchange")])
@pytest.mark.parametrize("name", ["rope", "pot", "pendulum", "rocker"])
def test_an_fmu_does_what_run_does(tmp_path, name, fmi, kind):
    duration, start = 1.2, {}
    if name == "rope":
        system, start = two_on_a_rope(force=-1.0), {"v0": {"x": 3.0, "y": 1.0}}
    elif name == "pot":
        system = table(
            lambda m, ball: Wall("pot", m.world, ball, radius=0.5, e=0.4), gravity=(0.3, -G, 0)
        )
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
