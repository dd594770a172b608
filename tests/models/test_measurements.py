"""Sensors: along motions by finite differences, and by closed forms."""

import re

import casadi
import numpy as np
import pytest
from support.body_balance import State, numbers, tree_state
from support.closed_mechanisms import closed_chain
from support.observed_four_bar import four_bar
from support.random_trees import ALL_KINDS, random_rotation, random_state, random_tree

import mbs
import mbs.models
from mbs.components import (
    AbsoluteSensor,
    Body,
    DistanceSensor,
    Free,
    JointSensor,
    PowerSensor,
    Prismatic,
    RelativeSensor,
    Revolute,
    Spherical,
    WrenchSensor,
)
from mbs.loops.closing import Closing, closure_parameters

STEP = 1e-4


def read(system, state, tau=None):
    """What the sensors read in a motion of the tree, by name of the output."""
    model = mbs.models.measurements(system, "tree")
    inputs = [state.q, state.v, state.a]
    if "tau" in model.name_in():
        inputs.append(np.zeros(system.nv) if tau is None else tau)
    outputs = model(*inputs)
    outputs = outputs if isinstance(outputs, tuple) else (outputs,)
    return {
        name: np.array(value) if value.shape[1] > 1 else np.array(value).ravel()
        for name, value in zip(model.name_out(), outputs, strict=True)
    }


def after(system, state, h):
    """The motion a time h later, on to second order, with closed loops and unit quaternions."""
    middle = state.v + h / 2 * state.a
    if system.is_closed:
        q = state.q + h * state.v + h**2 / 2 * state.a
        q = Closing(system, closure_parameters(system)).nearest(q).q
        return State(q, state.v + h * state.a, state.a)
    q = state.q
    for _ in range(20):
        q = q + h / 20 * numbers(system.qdot(q, middle)).ravel()
    for link in system.tree.links:
        if link.motion.value in ("spherical", "free"):
            part = slice(link.q.stop - 4, link.q.stop)
            q[part] /= np.linalg.norm(q[part])
    return State(q, state.v + h * state.a, state.a)


def vee(matrix):
    return np.array([matrix[2, 1], matrix[0, 2], matrix[1, 0]])


def points(rng, m):
    bodies = [m.world, *m.bodies()]
    a, b = (bodies[k] for k in rng.permutation(len(bodies))[:2])
    return [body.at(*rng.uniform(-0.5, 0.5, 3), rotation=random_rotation(rng)) for body in (a, b)]


def check_rates(system, state, names):
    """v, w, a, wd of sensors in their own observer's axes are the rates of p, R, v, w."""
    now = read(system, state)
    ends = [read(system, after(system, state, h)) for h in (STEP, -STEP)]
    rate = {key: (ends[0][key] - ends[1][key]) / (2 * STEP) for key in now}
    for name in names:
        np.testing.assert_allclose(now[f"{name}_v"], rate[f"{name}_p"], atol=2e-6)
        np.testing.assert_allclose(now[f"{name}_a"], rate[f"{name}_v"], atol=2e-5)
        np.testing.assert_allclose(now[f"{name}_wd"], rate[f"{name}_w"], atol=2e-5)
        spin = rate[f"{name}_R"] @ now[f"{name}_R"].T
        np.testing.assert_allclose(now[f"{name}_w"], vee(spin), atol=2e-6)
        assert min(np.abs(now[f"{name}_{key}"]).max() for key in ("p", "v")) > 1e-3
    return now, rate


@pytest.mark.parametrize("seed", range(4))
def test_motion_of_points_in_a_tree(seed):
    rng, m = np.random.default_rng(seed), random_tree(seed, n=5, kinds=ALL_KINDS).mechanism
    a, b = points(rng, m)
    m.add(AbsoluteSensor("one", b if b.owner is not m.world else a))
    m.add(RelativeSensor("two", a, b))
    m.add(DistanceSensor("gap", a, b))
    system = m.assemble()
    q, v, acc = random_state(system, rng)
    state = State(q, v, acc)
    now, rate = check_rates(system, state, ["one", "two"])
    assert now["gap_L"] == pytest.approx(np.linalg.norm(now["two_p"]), rel=1e-12)
    assert now["gap_Ld"] == pytest.approx(rate["gap_L"], abs=1e-6)
    frame = [b if b.owner is not m.world else a, a, b]
    poses = [numbers(mbs.models.transform(system, p.owner.name)(q)) for p in frame]
    poses = [T @ numbers(p.placement.pose({}).matrix) for T, p in zip(poses, frame, strict=True)]
    np.testing.assert_allclose(now["one_p"], poses[0][:3, 3], atol=1e-12)
    np.testing.assert_allclose(now["one_R"], poses[0][:3, :3], atol=1e-12)
    relative = np.linalg.inv(poses[1]) @ poses[2]
    np.testing.assert_allclose(now["two_p"], relative[:3, 3], atol=1e-12)
    np.testing.assert_allclose(now["two_R"], relative[:3, :3], atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_axes(seed):
    """The same vectors in other axes."""
    rng, m = np.random.default_rng(seed), random_tree(seed, n=4).mechanism
    a, b = points(rng, m)
    for axes in ("world", "body"):
        m.add(AbsoluteSensor(f"abs_{axes}", b, axes=axes))
        m.add(AbsoluteSensor(f"base_{axes}", a, axes=axes))
    for axes in ("a", "b", "world"):
        m.add(RelativeSensor(f"rel_{axes}", a, b, axes=axes))
        m.add(WrenchSensor(f"cut_{axes}", "j2", axes=axes))
    m.add(AbsoluteSensor("j2_a", m.components["j2"].frame_a, quantities=["R"]))
    m.add(AbsoluteSensor("j2_b", m.components["j2"].frame_b, quantities=["R", "v", "w"]))
    m.add(PowerSensor("power", "j2"))
    system = m.assemble()
    now = read(system, State(*random_state(system, rng)))
    R_a, R_b = now["base_world_R"], now["abs_world_R"]
    for key in ("p", "v", "w", "a", "wd"):
        np.testing.assert_allclose(now[f"abs_world_{key}"], R_b @ now[f"abs_body_{key}"])
        world = now[f"rel_world_{key}"]
        np.testing.assert_allclose(world, R_a @ now[f"rel_a_{key}"], atol=1e-12)
        np.testing.assert_allclose(world, R_b @ now[f"rel_b_{key}"], atol=1e-12)
    p = now["abs_world_p"] - now["base_world_p"]
    np.testing.assert_allclose(now["rel_world_p"], p, atol=1e-12)
    for key in ("f", "m"):
        world = now[f"cut_world_{key}"]
        np.testing.assert_allclose(world, now["j2_a_R"] @ now[f"cut_a_{key}"], atol=1e-12)
        np.testing.assert_allclose(world, now["j2_b_R"] @ now[f"cut_b_{key}"], atol=1e-12)
    F = numbers(mbs.models.joint_wrenches(system)(*random_state(system, np.random.default_rng(9))))
    assert F.shape == (6, 4)
    power = now["cut_world_f"] @ now["j2_b_v"] + now["cut_world_m"] @ now["j2_b_w"]
    assert now["power_P"] == pytest.approx(power)


def test_observers_that_turn_see_other_rates():
    """A point at rest, seen from a turntable: v = -w x p, a = -w x w x p - 2 w x v."""
    m = mbs.Mechanism("turntable", gravity=(0, 0, 0))
    table = m.add(Body("table", mass=1, inertia=(1, 1, 1)))
    m.connect(m.world, Revolute("j", axis="z", actuated=True), table)
    m.add(RelativeSensor("tree", table, m.world.at(2, 0, 0)))
    now = read(m.assemble(), State(np.array([0.0]), np.array([3.0]), np.array([0.0])))
    np.testing.assert_allclose(now["tree_p"], [2, 0, 0])
    np.testing.assert_allclose(now["tree_v"], [0, -6, 0])
    np.testing.assert_allclose(now["tree_a"], [-18, 0, 0])
    np.testing.assert_allclose(now["tree_w"], [0, 0, -3])


def pendulum(*sensors):
    m = mbs.Mechanism("pendulum", gravity=(0, -9.81, 0))
    bob = m.add(Body("bob", mass=2.0, com=(0, -0.7, 0)))
    m.connect(m.world, Revolute("j", actuated=False), bob)
    for make in sensors:
        m.add(make(m, bob))
    return m.assemble()


def test_pendulum():
    """Cut force m g cos + m w^2 l; an accelerometer on a swinging bob reads along the arm alone."""
    system = pendulum(
        lambda m, b: WrenchSensor("pin", "j"),
        lambda m, b: AbsoluteSensor("bob_at", b.at(0, -0.7, 0), axes="body"),
        lambda m, b: PowerSensor("power", "j"),
    )
    q, w = 0.6, 1.7
    a = float(mbs.models.direct_dynamics(system)(q, w, 0))
    now = read(system, State(*(np.array([x]) for x in (q, w, a))))
    tension = 2 * 9.81 * np.cos(q) + 2 * w**2 * 0.7
    np.testing.assert_allclose(now["pin_f"], [0, tension, 0], atol=1e-12)
    np.testing.assert_allclose(now["pin_m"], 0, atol=1e-12)
    specific = now["bob_at_a"] - now["bob_at_R"].T @ [0, -9.81, 0]
    np.testing.assert_allclose(specific, [0, tension / 2, 0], atol=1e-12)
    assert now["power_P"] == pytest.approx(0, abs=1e-12)


def test_four_bar():
    system = four_bar()
    state = tree_state(system, np.array([1.3]), np.array([-0.8]))
    now, rate = check_rates(system, state, ["tip", "seen"])
    for k in (1, 2, 3, 4):
        assert now[f"e{k}_v"] == pytest.approx(rate[f"e{k}_q"], abs=1e-6)
        assert now[f"e{k}_a"] == pytest.approx(rate[f"e{k}_v"], abs=1e-5)
    assert now["e1_q"] + now["e2_q"] + now["e3_q"] == pytest.approx(now["e4_q"])
    assert now["reach_Ld"] == pytest.approx(rate["reach_L"], abs=1e-6)
    reduced = mbs.models.measurements(system)
    assert reduced.name_in() == ["q", "v_a", "a_a"]
    outputs = dict(zip(reduced.name_out(), reduced(state.q, 1.3, -0.8), strict=True))
    for name in now:
        if not re.fullmatch("p(in|[1-4])_.", name):
            np.testing.assert_allclose(
                np.array(outputs[name]).squeeze(), now[name].squeeze(), atol=1e-10
            )
    wrenches = numbers(mbs.models.joint_wrenches(system)(state.q, 1.3, -0.8))
    number = [row.name for row in system.joints].index("j3")
    np.testing.assert_allclose(numbers(outputs["pin_f"]).ravel(), wrenches[:3, number])


def test_power_that_joints_bring_is_that_of_the_motor():
    """From the ground into the four-bar, j1 brings tau v, j4 nothing; inside it is passed on."""
    system = four_bar()
    state = tree_state(system, np.array([1.3]), np.array([-0.8]))
    tau = np.zeros(3)
    tau[0] = float(mbs.models.inverse_dynamics(system)(state.q, 1.3, -0.8))
    now = read(system, state, tau)
    assert now["p1_P"] == pytest.approx(tau[0] * 1.3)
    assert now["p4_P"] == pytest.approx(0, abs=1e-10)
    energy = mbs.models.energy(system, "tree")
    ends = [
        sum(float(x) for x in energy(s.q, s.v))
        for s in (after(system, state, h) for h in (STEP, -STEP))
    ]
    assert now["p1_P"] == pytest.approx((ends[0] - ends[1]) / (2 * STEP), rel=1e-4)
    assert np.abs(now["p3_P"]) > 0.1


@pytest.mark.sweep
@pytest.mark.parametrize("kind", ["revolute", "prismatic", "cylindrical", "universal", "planar"])
def test_coordinates_of_cut_joints(kind):
    mechanism, guess = closed_chain(2, kind)
    mechanism.assemble(guess=guess)
    names = [row.name for row in mechanism.assemble(guess=guess).cut_coordinates]
    for number, name in enumerate(names):
        mechanism.add(JointSensor(f"s{number}", name))
    system = mechanism.assemble(guess=guess)
    rng = np.random.default_rng(1)
    state = tree_state(system, *rng.uniform(-1, 1, (2, len(system.independent))))
    now = read(system, state)
    ends = [read(system, after(system, state, h)) for h in (STEP, -STEP)]
    for k in range(len(names)):
        slope, curve = ((ends[0][f"s{k}_{x}"] - ends[1][f"s{k}_{x}"]) / (2 * STEP) for x in "qv")
        np.testing.assert_allclose(now[f"s{k}_v"], slope, atol=1e-5)
        np.testing.assert_allclose(now[f"s{k}_a"], curve, atol=1e-4)
        assert np.abs(now[f"s{k}_v"]) > 1e-3
    if kind == "universal":  # what the two angles say is the orientation
        mechanism.add(RelativeSensor("rel", *ends_of(mechanism), quantities=("R",)))
        R = read(mechanism.assemble(guess=guess), state)["rel_R"]
        turns = [rotation(f.axis, now[f"s{k}_q"][0]) for k, f in enumerate(freedoms(mechanism))]
        np.testing.assert_allclose(R, turns[0] @ turns[1], atol=1e-9)


def ends_of(mechanism):
    joint = mechanism.components["closing"]
    return joint.frame_a, joint.frame_b


def freedoms(mechanism):
    return mechanism.components["closing"].freedoms


def rotation(axis, angle):
    K = -np.cross(np.eye(3), axis)
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def test_a_distance_of_nothing_has_a_rate():
    m = mbs.Mechanism("m", gravity=(0, 0, 0))
    b = m.add(Body("b", mass=1.0))
    m.connect(m.world, Prismatic("x", axis="x"), b)
    m.add(DistanceSensor("d", m.world, b))
    system = m.assemble()
    q, v = casadi.SX.sym("q"), casadi.SX.sym("v")
    L, rate = mbs.models.measurements(system)(q, v, 0)
    slopes = casadi.Function(
        "f", [q, v], [L, rate, casadi.jacobian(L, q), casadi.jacobian(rate, v)]
    )
    assert [float(x) for x in slopes(0, 2.0)] == [1e-12, 0, 0, 0]
    assert float(slopes(-0.3, 2.0)[1]) == pytest.approx(-2.0)


def test_coordinates_with_and_without_positions():
    m = mbs.Mechanism("m")
    for name, joint in (("ball", Spherical("ball")), ("float", Free("float"))):
        m.connect(m.world, joint, m.add(Body(f"{name}_body", mass=1, inertia=(1, 1, 1))))
    for number, name in enumerate(("ball.qw", "ball.wx", "float.x", "float.vx")):
        m.add(JointSensor(f"s{number}", name))
    system = m.assemble()
    assert mbs.models.measurements(system).name_out() == [
        *("s0_q", "s1_v", "s1_a", "s2_q", "s3_v", "s3_a")
    ]
    assert [unit for s in system.sensors for _, unit in s.columns] == [
        *("1", "rad/s", "rad/s2", "m", "m/s", "m/s2")
    ]
