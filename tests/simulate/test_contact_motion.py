"""Motions with contacts, against quadrature, closed forms and other integrators."""

import casadi
import fmpy
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.contact_quadruped import HIPS, MASSES, quadruped, start

import mbs
from mbs.components import (
    Body,
    Box,
    BoxPlaneContact,
    Free,
    HeightFieldContact,
    Prismatic,
    Revolute,
    RigidStop,
    RollingDisc,
    SpherePlaneContact,
    SphereSphereContact,
    WheelPlaneContact,
)

G = 9.81


def run(system, duration, **options):
    return mbs.simulate.run(system, duration, quiet=True, **{"tolerance": 1e-10, **options})


# A ball that falls and bounces.


MASS, RADIUS = 0.5, 0.1
LAW = {"stiffness": 1e5, "damping": 0.2}


def ball(gravity=-G, **law):
    """A ball that moves up and down."""
    m = mbs.Mechanism("ball", gravity=(0, 0, gravity))
    body = m.add(Body("b", mass=MASS, inertia=(2e-3, 2e-3, 2e-3)))
    m.connect(m.world, Prismatic("z", axis="z", actuated=False), body)
    m.add(SpherePlaneContact("c", body, m.world, radius=RADIUS, **(law or LAW)))
    return m.assemble()


def force(depth, rate, k=1e5, c=0.2):
    return k * max(depth, 0.0) ** 1.5 * max(0.0, 1 + c * rate)


@pytest.mark.parametrize("method", ["dopri5", "rodas"])
def test_a_ball_bounces_as_its_law_says(method):
    def falls(_, y):
        return [y[1], force(RADIUS - y[0], -y[1]) / MASS - G]

    def touches(_, y):
        return y[0] - RADIUS

    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "events": touches}
    times = np.linspace(0, 1.5, 31)
    # an impact takes milliseconds
    found = solve_ivp(falls, (0, 1.5), [0.6, 0.0], t_eval=times, max_step=1e-3, **options)
    result = run(ball(), 1.5, q0={"z": 0.6}, step=0.05, method=method)
    assert len(found.t_events[0]) >= 4  # two impacts
    np.testing.assert_allclose(result["z.q"], found.y[0], rtol=0, atol=1e-6)
    np.testing.assert_allclose(result["z.v"], found.y[1], rtol=0, atol=1e-6)


@pytest.mark.parametrize("stiffness", [1e4, 1e9])
@pytest.mark.parametrize("e", [0.3, 0.9])
def test_restitution_is_exact_at_its_speed(stiffness, e):
    system = ball(0.0, stiffness=stiffness, restitution=e, impact_speed=3.0)
    result = run(system, 1.0, q0={"z": 0.5}, v0={"z": -3.0}, step=0.5)
    assert result["z.v"][-1] == pytest.approx(3 * e, rel=1e-8)


def test_the_energy_lost_is_the_heat():
    result = run(ball(), 0.6, q0={"z": 0.6}, step=2e-5)
    E = result["kinetic_energy"] + result["potential_energy"]
    depth, rate = np.maximum(result["c.depth"], 0), -result["z.v"]
    heat = (result["c.normal_force"] - 1e5 * depth**1.5) * rate
    lost = np.sum((heat[1:] + heat[:-1]) / 2) * 2e-5
    assert E[0] - E[-1] == pytest.approx(lost, rel=1e-5)
    assert lost > 1


def test_a_fall_from_high_in_long_steps_is_not_lost_in_the_ground():
    system = ball(stiffness=1e10, damping=0.0)
    result = run(system, 20.0, q0={"z": 0.1 + G * 8}, step=5.0, tolerance=1e-8)  # 4 s of fall
    E = result["kinetic_energy"] + result["potential_energy"]
    np.testing.assert_allclose(E, E[0], rtol=1e-6)
    assert result["z.q"].min() > 0.09


# Steps end where contact begins and ends.


def two_balls():
    """Two small balls that run towards each other along x."""
    m = mbs.Mechanism("two", gravity=(0, 0, 0))
    bodies = [m.add(Body(f"b{k}", mass=1.0, inertia=(1, 1, 1))) for k in (1, 2)]
    for k, body in enumerate(bodies, 1):
        m.connect(m.world, Prismatic(f"x{k}", axis="x", actuated=False), body)
    m.add(SphereSphereContact("c", *bodies, radius_a=0.01, radius_b=0.01, stiffness=1e8))
    return m.assemble()


@pytest.mark.parametrize("method", ["dopri5", "rodas"])
def test_balls_do_not_pass_through_each_other(method):
    given = {"q0": {"x1": -50.0, "x2": 40.0}, "v0": {"x1": 10.0, "x2": -30.0}}
    result = run(two_balls(), 10.0, step=5.0, method=method, tolerance=1e-6, **given)
    np.testing.assert_allclose([result["x1.v"][-1], result["x2.v"][-1]], [-30, 10], rtol=1e-7)
    assert result.events == ()


def test_crossings_leave_other_events_alone():
    m = mbs.Mechanism("both", gravity=(0, 0, -G))
    bodies = [m.add(Body(name, mass=MASS)) for name in ("b", "d")]
    for body, name in zip(bodies, "zs", strict=True):
        m.connect(m.world, Prismatic(name, axis="z", actuated=False), body)
    m.add(SpherePlaneContact("c", bodies[0], m.world, radius=RADIUS, **LAW))
    m.add(RigidStop("stop", joint="s", lower=0.0, restitution=0.5))
    both = run(m.assemble(), 1.0, q0={"z": 0.6, "s": 1.0}, step=0.1)
    alone = run(ball(), 1.0, q0={"z": 0.6}, step=0.1)
    np.testing.assert_allclose(both["z.q"], alone["z.q"], rtol=0, atol=1e-8)
    fall = np.sqrt(2 / G)
    assert [event[1:] for event in both.events] == [("stop", "bounces off lower")] * 2
    assert [event[0] for event in both.events] == pytest.approx([fall, 2 * fall], rel=1e-8)
    assert both["stop.mode"].tolist() == [0] * 11


def test_a_closed_loop_meets_a_contact():
    m = mbs.Mechanism("four_bar", gravity=(0, -G, 0))
    lengths = {"a": 0.4, "b": 1.0, "c": 0.9}
    a, b, c = (m.add(Box(n, length=x, width=0.05, density=2700)) for n, x in lengths.items())
    m.connect(m.world, Revolute("j1", axis="z", actuated=False), a.left)
    m.connect(a.right, Revolute("j2", axis="z"), b.left)
    m.connect(b.right, Revolute("j3", axis="z"), c.right)
    m.connect(m.world.at(0.8, 0, 0), Revolute("j4", axis="z"), c.left)
    floor = m.world.at(0, -0.3, 0, rotation=("x", -np.pi / 2))  # its z is up
    m.add(SpherePlaneContact("c1", a.right, floor, radius=0.02, stiffness=1e7))
    system = m.assemble(guess={"j2": 1.0})
    result = run(system, 2.0, q0={"j1": 0.3}, step=1e-3)
    E = result["kinetic_energy"] + result["potential_energy"]
    np.testing.assert_allclose(E, E[0], rtol=0, atol=1e-7)
    assert result["c1.depth"].max() > 1e-4  # it bounced
    assert result["c1.depth"].max() < 0.01
    assert result["closure_residual"].max() < 1e-11


def test_a_rolling_disc_runs_against_a_wall():
    m = mbs.Mechanism("disc", gravity=(0, 0, -G))
    disc = m.add(Body("disc", mass=1.0, inertia=(0.02, 0.04, 0.02)))
    m.connect(m.world, Free("f"), disc)
    m.connect(m.world, RollingDisc("roll", radius=0.3), disc)
    wall = m.world.at(2, 0, 0, rotation=("y", -np.pi / 2))
    m.add(SpherePlaneContact("c", disc, wall, radius=0.3, stiffness=1e6))
    system = m.assemble(guess={"f.z": 0.3})
    result = run(system, 3.0, v0={"f.vx": 1.0}, step=0.5, tolerance=1e-9)
    E = result["kinetic_energy"] + result["potential_energy"]
    np.testing.assert_allclose(E, E[0], rtol=1e-6)
    assert result["f.x.q"].max() < 1.71
    assert result["f.x.q"][-1] == pytest.approx(2 * 1.7 - 3.0, abs=0.05)


# Friction: what stands, slides and rolls.


def block(angle, **law):
    """A block on a slope of 0.6 friction, and the height of its middle where it rests [m]."""
    m = mbs.Mechanism("block", gravity=(G * np.sin(angle), 0, -G * np.cos(angle)))
    body = m.add(Body("b", mass=2.0, inertia=(0.01, 0.02, 0.03)))
    m.connect(m.world, Free("f"), body)
    given = {"stiffness": 1e6, "damping": 0.5, "friction": 0.6, **law}
    m.add(BoxPlaneContact("c", body, m.world, size=(0.4, 0.3, 0.2), **given))
    depth = (2 * G * np.cos(angle) / 4 / 1e6) ** (2 / 3)
    return m.assemble(), 0.1 - depth


def test_a_block_stands_below_the_angle_of_friction():
    for degrees in (10, 25):
        system, height = block(np.radians(degrees), friction_law="bristle")
        result = run(system, 8.0, q0={"f.z": height}, step=1.0, tolerance=1e-8)
        x = result["f.x.q"]
        assert 1e-6 < x[1] < 2e-4  # the bristles have bent
        assert abs(x[-1] - x[1]) < 1e-7
        assert abs(x[-1] - x[4]) < 1e-10  # half of it: nothing creeps


def test_a_block_slides_above_it():
    angle = np.radians(35)
    wanted = G * (np.sin(angle) - 0.6 * np.cos(angle))
    for law in ("bristle", "regularised"):
        system, height = block(angle, friction_law=law)
        result = run(system, 3.0, q0={"f.z": height}, step=0.5, tolerance=1e-8)
        v = result["f.vx.v"]
        assert (v[-1] - v[2]) / 2 == pytest.approx(wanted, rel=1e-3)


def test_regularised_friction_creeps_as_documented():
    angle = np.radians(25)
    system, height = block(angle)
    result = run(system, 2.0, q0={"f.z": height}, step=1.0, tolerance=1e-8)
    share = np.tan(angle) / 0.6
    creep = 1e-3 * share / np.sqrt(1 - share**2)
    assert result["f.vx.v"][-1] == pytest.approx(creep, rel=1e-3)


@pytest.mark.parametrize("law", ["bristle", "regularised"])
def test_a_ball_rolls_up_a_ramp(law):
    angle, v0 = 0.2, 2.0
    m = mbs.Mechanism("ball", gravity=(-G * np.sin(angle), 0, -G * np.cos(angle)))
    body = m.add(Body("b", mass=1.0, inertia=(0.004, 0.004, 0.004)))  # 2/5 m r^2
    m.connect(m.world, Free("f"), body)
    given = {"stiffness": 1e6, "friction": 0.8, "friction_law": law, "width": 1e-4}
    m.add(SpherePlaneContact("c", body, m.world, radius=0.1, **given))
    depth = (G * np.cos(angle) / 1e6) ** (2 / 3)
    arm = 0.1 - depth / 2  # from the centre to where it rolls
    result = run(
        m.assemble(),
        1.0,
        q0={"f.z": 0.1 - depth},
        v0={"f.vx": v0, "f.wy": v0 / arm},
        step=1e-3,
        tolerance=1e-9,
    )
    slows = G * np.sin(angle) / (1 + 0.004 / arm**2)
    s = v0 * result.time - slows * result.time**2 / 2
    np.testing.assert_allclose(result["f.x.q"], s, rtol=0, atol=1e-3)
    E = result["kinetic_energy"] + result["potential_energy"]
    # friction takes what the slip says, and bristles hold next to nothing
    heat = np.sum((result["c.friction_force"] * result["c.slip"])[1:]) * 1e-3
    assert E[0] - E[-1] == pytest.approx(heat, abs=2e-4)
    assert heat < 1e-3


def test_a_leaning_wheel_rolls_as_a_rolling_disc():
    def wheel(add):
        m = mbs.Mechanism("wheel", gravity=(0, 0, -G))
        body = m.add(Body("b", mass=1.0, inertia=(0.02, 0.04, 0.02)))
        m.connect(m.world, Free("f"), body)
        add(m, body)
        return m.assemble(guess={"f.z": 0.3})

    lean = 0.15
    turn = {"f.qw": np.cos(lean / 2), "f.qx": np.sin(lean / 2), "f.z": 0.3 * np.cos(lean)}
    speed = {"f.vx": 2.0, "f.vy": 0.0, "f.vz": 0.0, "f.wx": 0.0, "f.wy": 2 / 0.3, "f.wz": 0.0}
    law = {"stiffness": 1e8, "damping": 2.0, "friction": 2.0, "friction_law": "bristle"}
    law |= {"bristle": 1e-5, "bristle_time": 2e-3}
    touching = wheel(lambda m, b: m.add(WheelPlaneContact("c", b, m.world, radius=0.3, **law)))
    rolling = wheel(lambda m, b: m.connect(m.world, RollingDisc("c", radius=0.3), b))
    free = {k: v for k, v in speed.items() if k in ("f.wx", "f.wy", "f.wz")}
    options = {"q0": turn, "step": 0.1, "tolerance": 1e-8}
    one = run(touching, 1.0, v0=speed, **options)
    other = run(rolling, 1.0, v0=free, **options)
    for name in ("f.x.q", "f.y.q", "f.z.q", "f.qx.q"):
        np.testing.assert_allclose(one[name], other[name], rtol=0, atol=2e-3)
    assert abs(other["f.y.q"][-1]) > 0.1  # it runs in a curve


def test_a_point_in_a_bowl_keeps_its_energy():
    m = mbs.Mechanism("bowl", gravity=(0, 0, -G))
    body = m.add(Body("b", mass=1.0, inertia=(0.01, 0.01, 0.01)))
    m.connect(m.world, Free("f"), body)
    m.add(
        HeightFieldContact(
            "c", body, m.world, radius=0.1, height=lambda x, y: (x**2 + 2 * y**2) / 2, stiffness=1e6
        )
    )
    start = {"f.x": 0.5, "f.y": 0.3, "f.z": 0.5}
    result = run(m.assemble(), 5.0, q0=start, step=0.01, tolerance=1e-9)
    E = result["kinetic_energy"] + result["potential_energy"]
    np.testing.assert_allclose(E, E[0], rtol=0, atol=1e-6)
    assert np.diff(np.sign(result["c.depth"])).any()


# Feet.


def test_a_quadruped_that_is_dropped_stands():
    result = run(quadruped(), 3.0, q0=start(0.5), step=0.1, tolerance=1e-7)
    assert result["fl_foot.depth"][0] < -0.1  # it began in the air
    forces = [result[f"{leg}_foot.normal_force"][-1] for leg in HIPS]
    weight = G * (MASSES["trunk"] + 4 * (MASSES["upper"] + MASSES["lower"]))
    assert sum(forces) == pytest.approx(weight, rel=2e-3)
    assert min(forces) > 15
    assert 0.33 < result["free.z.q"][-1] < 0.36
    moving = [name for name in result.units if name.endswith(".v")]
    assert max(abs(result[name][-1]) for name in moving) < 2e-3
    slips = [result[f"{leg}_foot.slip"][-1] for leg in HIPS]
    assert max(slips) < 1e-5


# The same motion by an FMU and by CVODES.


def thrown():
    """A ball that bounces along a table and begins to roll."""
    m = mbs.Mechanism("thrown", gravity=(0, 0, -G))
    under = m.world
    for name in "xz":
        carriage = m.add(Body(f"at_{name}", mass=0))
        m.connect(under, Prismatic(name, axis=name, actuated=False), carriage)
        under = carriage
    body = m.add(Body("b", mass=MASS, inertia=(2e-3, 2e-3, 2e-3)))
    m.connect(under, Revolute("turn", axis="y", actuated=False), body)
    law = {"stiffness": 1e5, "restitution": 0.7, "impact_speed": 2.0, "friction": 0.4}
    m.add(SpherePlaneContact("c", body, m.world, radius=RADIUS, friction_law="bristle", **law))
    return m.assemble()


STARTS = {"x.v": 1.0, "z.q": 0.3}


@pytest.fixture(scope="module")
def reference():
    system = thrown()
    result = run(system, 1.0, q0={"z": 0.3}, v0={"x": 1.0}, step=0.05, tolerance=1e-11)
    return system, result


NAMES = [f"{name}.{kind}" for name in ("x", "z", "turn") for kind in "qv"]


def test_it_bounced_and_turns(reference):
    _, result = reference
    assert np.sum(np.diff(np.sign(result["z.v"])) > 0) >= 2
    assert result["turn.v"][-1] > 1


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_an_fmu_bounces_alike(reference, kind, tmp_path):
    system, result = reference
    path = tmp_path / "thrown.fmu"
    mbs.export.fmu(system, path)
    found = fmpy.simulate_fmu(
        str(path),
        fmi_type=kind,
        stop_time=1.0,
        output_interval=0.005,  # fmpy's CVODE takes 500 steps from one to the next
        start_values=STARTS,
        output=[*NAMES, "c.normal_force"],
        record_events=False,  # contacts begin and end at events
        relative_tolerance=1e-11,
    )
    for name in NAMES:
        np.testing.assert_allclose(found[name][::10], result[name], rtol=0, atol=1e-7)


def test_cvodes_bounces_alike(reference):
    system, result = reference
    d = mbs.models.dae(system, q0={"z": 0.3}, v0={"x": 1.0})
    options = {"abstol": 1e-12, "reltol": 1e-12, "max_num_steps": 200_000}
    motion = casadi.integrator("motion", "cvodes", d.casadi(), 0, list(result.time), options)
    x = np.array(motion(x0=d.x0, p=d.p0)["xf"])
    for row, (name, _) in enumerate(d.elements["x"]):
        if name in NAMES:
            np.testing.assert_allclose(x[row], result[name], rtol=0, atol=1e-7)
