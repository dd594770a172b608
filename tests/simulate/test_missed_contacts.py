"""Contacts that steps could pass over: fast flights at small bodies, rotors, bumps."""

import casadi
import numpy as np
import pytest

import mbs
from mbs.components import (
    Body,
    CapsuleCapsuleContact,
    Cartesian,
    Free,
    HeightFieldContact,
    PointMass,
    Revolute,
    SphereBoxContact,
    SphereCapsuleContact,
    SpherePlaneContact,
    SphereSphereContact,
    custom,
)
from mbs.errors import AssemblyError, ModelError
from mbs.simulate import Simulator
from mbs.solvers import Events, integrate_events

METHODS = ["dopri5", "rodas"]

# A ball that flies at a body and is reflected by it.


LAW = {"stiffness": "k"}
OBSTACLES = {
    "sphere": lambda ball, body: SphereSphereContact(
        "c", body, ball, radius_a="s", radius_b="r", **LAW
    ),
    "capsule": lambda ball, body: SphereCapsuleContact(
        "c", ball, body, radius="r", capsule_radius="s", length=0.3, **LAW
    ),
    "plane": lambda ball, body: SpherePlaneContact("c", ball, body, radius="r", **LAW),
    "edge": lambda ball, body: SphereBoxContact(
        "c", ball, body, radius="r", size=("s", "s", "s"), **LAW
    ),
}


def flight(obstacle):
    """A ball and an obstacle, which both move without rotation."""
    values = {"k": 1e6, "r": 0.01, "s": 0.01}
    if obstacle == "plane":
        del values["s"]
    m = mbs.Mechanism("flight", gravity=(0, 0, 0), parameters=values)
    bodies = [m.add(PointMass(name, mass=1.0)) for name in ("ball", "body")]
    for name, body in zip(("j", "o"), bodies, strict=True):
        m.connect(m.world, Cartesian(name), body)
    m.add(OBSTACLES[obstacle](*bodies))
    return m.assemble()


def direction(random):
    found = random.normal(size=3)
    return found / np.linalg.norm(found)


def hit(obstacle, random, r, s):
    """Centre of the ball when it touches, seen from the obstacle, and the normal there."""
    if obstacle == "plane":
        return np.array([*random.uniform(-1, 1, 2), r]), np.array([0.0, 0, 1])
    if obstacle == "sphere":
        normal = direction(random)
        return (r + s) * normal, normal
    if obstacle == "capsule":
        angle = random.uniform(0, 2 * np.pi)
        normal = np.array([np.cos(angle), np.sin(angle), 0.0])
        return np.array([0, 0, random.uniform(-0.15, 0.15)]) + (r + s) * normal, normal
    along = random.uniform(-0.45, 0.45) * s  # on the edge along z
    angle = random.uniform(0.1, np.pi / 2 - 0.1)
    normal = np.array([np.cos(angle), np.sin(angle), 0.0])
    return np.array([s / 2, s / 2, along]) + r * normal, normal


def start_of_flight(obstacle, random):
    """Positions, velocities, parameters and duration of a flight, and the velocity after it."""
    speed = 10 ** random.uniform(0, 3)
    r, s = 10 ** random.uniform(-3, -1, 2)
    place, normal = hit(obstacle, random, r, s)
    heading = direction(random)
    while heading @ normal > -0.3:
        heading = direction(random)
    distance = random.uniform(0.2, 20)
    drift = 0.5 * speed * direction(random)
    v = {"j": speed * heading + drift, "o": drift}
    q = {"j": place - distance * heading, "o": np.zeros(3)}
    # the obstacle is as heavy as the ball: it sinks in by a thousandth
    stiffness = 0.5 * 1.25 * speed**2 / (1e-3 * min(r, s)) ** 2.5
    after = v["j"] - (speed * heading @ normal) * normal
    given = {"k": stiffness, "r": r} | ({} if obstacle == "plane" else {"s": s})
    return q, v, given, 2 * distance / speed, after


def named(values):
    return {
        f"{name}.{axis}": x
        for name, row in values.items()
        for axis, x in zip("xyz", row, strict=True)
    }


def fly(obstacle, method, count, seed):
    """Number of flights that were not reflected."""
    random = np.random.default_rng(seed)
    simulator = Simulator(flight(obstacle), method=method)
    missed = 0
    for _ in range(count):
        q, v, given, duration, after = start_of_flight(obstacle, random)
        result = simulator(duration, q0=named(q), v0=named(v), parameters=given, step=duration)
        found = np.array([result[f"j.{axis}.v"][-1] for axis in "xyz"])
        missed += np.linalg.norm(found - after) > 0.02 * np.linalg.norm(v["j"] - v["o"])
    return missed


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("obstacle", OBSTACLES)
def test_fast_flights_are_reflected(obstacle, method):
    assert fly(obstacle, method, 20, 1) == 0


@pytest.mark.sweep
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("obstacle", OBSTACLES)
def test_two_thousand_flights_are_reflected(obstacle, method):
    assert fly(obstacle, method, 250, 2) == 0


# Capsules that tumble.


def capsules():
    m = mbs.Mechanism("capsules", gravity=(0, 0, -9.81))
    bodies = [m.add(Body(name, mass=1.0, inertia=(0.02, 0.02, 0.005))) for name in "ab"]
    for body in bodies:
        m.connect(m.world, Free(f"f{body.name}"), body)
    sizes = {"radius_a": 0.01, "length_a": 0.3, "radius_b": 0.005, "length_b": 0.2}
    m.add(CapsuleCapsuleContact("c", *bodies, stiffness=1e8, **sizes))
    return m.assemble()


@pytest.mark.sweep
@pytest.mark.parametrize("method", METHODS)
def test_tumbling_capsules_meet_as_in_short_steps(method):
    """Against runs whose steps are far shorter than a contact."""
    simulator, random = Simulator(capsules(), method=method), np.random.default_rng(7)
    struck = 0
    for _ in range(10):
        speed, turn = 10 ** random.uniform(0, 2), 10 ** random.uniform(0, 2)
        q0 = {"fb.x": -1.0, "fb.y": random.uniform(-0.08, 0.08)}
        v0 = {"fb.vx": speed}
        for name in ("fa", "fb"):
            q0[f"{name}.qw"], q0[f"{name}.qx"] = np.cos(0.7), np.sin(0.7)
            v0 |= {f"{name}.w{axis}": turn * random.normal() for axis in "xyz"}
        given = {"q0": q0, "v0": v0, "step": 0.02 / speed, "tolerance": 1e-9}
        ends = []
        for longest in (None, 2e-4 / (speed + 0.2 * turn)):
            result = simulator(1.2 / speed, max_step=longest, **given)
            names = [name for name in result.units if name.endswith(".v")]
            ends.append([result[name][-1] for name in names])
        struck += result["c.depth"].max() > -1e-3
        np.testing.assert_allclose(*ends, rtol=0, atol=1e-4 * (speed + turn))
    assert struck >= 2


# An arm that turns without forces: a step is as long as the motion.


def rotor(obstacle):
    """An arm of 1 m that turns about z, and an obstacle on its circle at the angle 3 rad."""
    m = mbs.Mechanism("rotor", gravity=(0, 0, 0), parameters={"k": 1e6})
    arm = m.add(Body("arm", mass=1.0, inertia=(1, 1, 1)))
    m.connect(m.world, Revolute("j", axis="z"), arm)
    at, tip = m.world.at(np.cos(3), np.sin(3), 0), arm.at(1, 0, 0)
    if obstacle == "sphere":
        m.add(SphereSphereContact("c", at, tip, radius_a=0.005, radius_b=0.005, **LAW))
    elif obstacle == "box":
        m.add(SphereBoxContact("c", tip, at, radius=0.005, size=(0.01, 0.01, 0.01), **LAW))
    elif obstacle == "paddle":  # the arm is a plane, whose normal is y
        at = m.world.at(0.9 * np.cos(3), 0.9 * np.sin(3), 0)
        m.add(SpherePlaneContact("c", at, arm.at(rotation=("x", -np.pi / 2)), radius=0.01, **LAW))
    else:  # the tip touches a plane after most of half a revolution
        wall = m.world.at(np.cos(3), 0, 0, rotation=("y", np.pi / 2))
        m.add(SpherePlaneContact("c", tip, wall, radius=0.001, **LAW))
    return m.assemble()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("obstacle", ["sphere", "box", "paddle", "plane"])
def test_a_rotor_meets_what_is_on_its_circle(obstacle, method):
    system = rotor(obstacle)
    for speed in (1.0, 30.0, 1000.0):
        given = {"k": 2e2 * speed**2 / 0.005**2.5}
        result = mbs.simulate.run(
            system,
            3.5 / speed,
            v0={"j": speed},
            parameters=given,
            step=3.5 / speed,
            method=method,
            quiet=True,
        )
        assert result["j.v"][-1] == pytest.approx(-speed, rel=1e-6)


class Post(custom.Custom):
    """A wall in a sector of the circle of a point, which pushes along the angle."""

    joint = custom.coordinate()

    def _off(self, at):
        """Sine of half the angle to the post, less that of its edge."""
        return casadi.sqrt((1 - casadi.cos(at.joint.q - 3)) / 2 + 1e-12) - 0.005

    def energy(self, at):
        return 1e8 * casadi.fmax(-self._off(at), 0) ** 2

    def crossings(self, at):
        speed = casadi.fabs(at.joint.v)
        return {"post": custom.Approach(self._off(at), speed / 2, speed / 0.01)}


class PlainPost(Post):
    def crossings(self, at):
        return {"post": self._off(at)}


@pytest.mark.parametrize(("kind", "end"), [(Post, -10.0), (PlainPost, 10.0)])
def test_components_of_users_tell_how_fast_they_are_approached(kind, end):
    """Without speed and pace a step of half a revolution passes over the post."""
    m = mbs.Mechanism("post", gravity=(0, 0, 0))
    arm = m.add(Body("arm", mass=1.0, inertia=(1, 1, 1)))
    m.connect(m.world, Revolute("j", axis="z"), arm)
    m.add(kind("p", "j"))
    result = mbs.simulate.run(m.assemble(), 0.5, v0={"j": 10.0}, step=0.5, quiet=True)
    assert result["j.v"][-1] == pytest.approx(end, rel=1e-6)


def test_a_pace_of_the_wrong_shape_is_refused():
    class Wrong(Post):
        def crossings(self, at):
            return {"post": custom.Approach(at.joint.q, None, casadi.SX(2, 1))}

    m = mbs.Mechanism("post", gravity=(0, 0, 0))
    arm = m.add(Body("arm", mass=1.0, inertia=(1, 1, 1)))
    m.connect(m.world, Revolute("j", axis="z"), arm)
    m.add(Wrong("p", "j"))
    with pytest.raises(AssemblyError, match="the pace of the crossing 'post'"):
        m.assemble()


def test_all_is_the_same_without_a_compiler(monkeypatch):
    monkeypatch.setitem(integrate_events.__globals__, "compiler_found", lambda: False)
    assert fly("edge", "dopri5", 4, 3) == fly("capsule", "rodas", 2, 4) == 0
    for obstacle in ("sphere", "paddle"):
        result = mbs.simulate.run(
            rotor(obstacle),
            3.5 / 30,
            v0={"j": 30.0},
            parameters={"k": 2e2 * 30**2 / 0.005**2.5},
            step=3.5 / 30,
            quiet=True,
        )
        assert result["j.v"][-1] == pytest.approx(-30, rel=1e-6)


def test_interpreted_functions_meet_it_too():
    """A point on a circle, whose first steps pass over the obstacle without looks."""
    t, x, p = (casadi.SX.sym(name, n) for name, n in (("t", 1), ("x", 2), ("p", 1)))
    gap = casadi.sqrt(2 - 2 * casadi.cos(x[0] - 3) + 1e-12) - 0.01
    rhs = casadi.Function("rhs", [t, x, p], [casadi.vertcat(x[1], 0)])
    g = casadi.Function("g", [t, x, p], [p * gap])
    jump = casadi.Function(
        "jump", [t, x, p, casadi.SX.sym("f")], [casadi.vertcat(x[0], -x[1]), casadi.SX(1)]
    )
    near = casadi.Function("near", [t, x, p], [casadi.horzcat(casadi.fabs(x[1]), 100, 0)])
    ends = []
    for approaches in (near, None):
        for compiled in (True, False):
            events = Events(g, jump, [1.0], approaches=approaches)
            motion = integrate_events(rhs, [0, 20.0], [0, 0.2], events, compiled=compiled)
            ends.append(motion.x[-1])
    np.testing.assert_allclose(ends[0], [2 * (3 - 0.01) - 4, -20], atol=1e-5)
    assert ends[1].tobytes() == ends[0].tobytes()
    np.testing.assert_allclose(ends[2:], 2 * [[4, 20]], atol=1e-12)  # two looks miss it


def test_approaches_have_three_columns():
    t, x, p = (casadi.SX.sym(name) for name in "txp")
    g = casadi.Function("g", [t, x, p], [x])
    rhs = casadi.Function("rhs", [t, x, p], [-x])
    jump = casadi.Function("jump", [t, x, p, casadi.SX.sym("f")], [x, p])
    with pytest.raises(ModelError, match=r"approaches\(t, x, p\) -> a, a \(1, 3\)"):
        integrate_events(rhs, [1], [0, 1], Events(g, jump, [1.0], approaches=g))


# A ball on a ground with one bump.


def bumpy(width, **options):
    m = mbs.Mechanism("ground", gravity=(0, 0, -9.81))
    ball = m.add(PointMass("b", mass=1.0))
    m.connect(m.world, Cartesian("j"), ball)

    def height(x, y):
        return 0.02 * casadi.exp(-(((x - 1) / width) ** 2))

    law = {"stiffness": 1e6, "damping": 1.0, "height": height}
    m.add(HeightFieldContact("c", ball, m.world, **law, **options))
    return m.assemble()


@pytest.mark.parametrize("radius", [0.0, 0.01, 0.05])
@pytest.mark.parametrize("width", [0.1, 0.03])
def test_the_stiff_method_follows_every_bump(width, radius):
    """Both methods jump off the bump alike; a step over it leaves the ball on the ground."""
    system, rest = bumpy(width, radius=radius), (9.81 / 1e6) ** (2 / 3)
    for speed in (1.0, 5.0, 20.0):
        heights = []
        for method in METHODS:
            result = mbs.simulate.run(
                system,
                1.5 / speed,
                q0={"j.z": radius - rest},
                v0={"j.x": speed},
                step=0.001 / speed,
                tolerance=1e-7,
                method=method,
                quiet=True,
            )
            heights.append(result["j.z.q"].max() - radius)
        assert heights[0] > 0.019
        assert heights[1] == pytest.approx(heights[0], rel=1e-4)


def test_the_width_of_bumps_can_be_given():
    """A bump of 2 mm is below the radius of 50 mm: it is met where its width is given."""
    system = bumpy(0.002, radius=0.05, spacing=0.002)
    rest = (9.81 / 1e6) ** (2 / 3)
    speeds = [
        mbs.simulate.run(
            system,
            0.3,
            q0={"j.z": 0.05 - rest},
            v0={"j.x": 5.0},
            method=method,
            quiet=True,
        )["j.z.v"].max()
        for method in METHODS
    ]
    assert speeds[0] > 0.4
    assert speeds[1] == pytest.approx(speeds[0], rel=1e-3)
