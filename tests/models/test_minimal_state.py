"""The state equation of the independent joints: wrenches and motions as inputs, and laws."""

import casadi
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.contact_mechanisms import five_bar, stick_slip, stopped_rocker
from support.minimal_runs import moved, start_of

import mbs
from mbs import Mechanism
from mbs.assembly.tree import normalised
from mbs.components import (
    Box,
    CoulombFriction,
    Force,
    Free,
    Revolute,
    Spherical,
    Torque,
)
from mbs.errors import ModelError
from mbs.models import direct_dynamics, hybrid_dynamics, transform
from mbs.models.state.independent import DriveInputs, consistent_start, minimal_state


def floating():
    """Two boxes, one of them free, with a point on the other."""
    m = Mechanism("floating", gravity=(0, 0, -9.81))
    body = m.add(Box("body", length=0.4, width=0.1, density=1000))
    arm = m.add(Box("arm", length=0.3, width=0.1, density=1000))
    m.connect(m.world, Free("f"), body)
    m.connect(body.right, Revolute("j", axis="y", actuated=True), arm.left)
    m.add_frame("tip", arm.at(0.3, 0.1, 0.2))
    return m.assemble()


def random_point(system, state, seed=0):
    """x and z of a configuration that closes the loops, with random velocities."""
    rng = np.random.default_rng(seed)
    x, z = (np.array(part) for part in consistent_start(system, state))
    x[len(state.positions) :] = rng.uniform(-1, 1, len(x) - len(state.positions))
    return x, z, rng


def configuration(system, state, x, z):
    """(nq,) positions, quaternions of unit length."""
    q = np.zeros(system.nq)
    q[list(state.positions)], q[list(state.dependents)] = x[: len(state.positions)], z
    symbols = casadi.SX.sym("q", system.nq)
    unit = casadi.Function("unit", [symbols], [normalised(system.tree, symbols)])
    return np.array(unit(q))[:, 0]


def numeric(system, pose):
    return np.array(casadi.Function("pose", [system.p], [pose.matrix])(system.p_default))


def on_body(system, q, frame, wrench):
    """f_ext (6, bodies) for a wrench on a frame about its origin in axes of the base."""
    link, pose = system.frame(frame)
    number = next(k for k, b in enumerate(system.bodies) if system.frames[b.name][0] == link)
    T = np.linalg.inv(numeric(system, system.frames[system.bodies[number].name][1]))
    T = T @ numeric(system, pose)
    R = T[:3, :3] @ np.array(transform(system, frame)(q))[:3, :3].T
    force, moment = R @ wrench[:3], R @ wrench[3:]
    f_ext = np.zeros((6, len(system.bodies)))
    f_ext[:, number] = -np.concatenate([force, moment + np.cross(T[:3, 3], force)])
    return f_ext


_WRENCHES = {
    "arm": (lambda: catalogue_system("puma560"), "link6"),
    "link number": (lambda: catalogue_system("puma560"), 4),
    "closed": (lambda: catalogue_system("sr400"), "link8"),
    "floating": (floating, "arm"),
    "point": (floating, "tip"),
}


@pytest.mark.parametrize("name", _WRENCHES)
def test_a_wrench_on_a_frame_is_the_opposite_of_f_ext(name):
    build, frame = _WRENCHES[name]
    system = build()
    state = minimal_state(system, drive=DriveInputs(wrenches=(frame,)))
    x, z, rng = random_point(system, state)
    tau, wrench = rng.uniform(-5, 5, len(state.inputs)), rng.uniform(-5, 5, 6)
    xdot, _ = state.rhs(0.0, x, z, [*tau, *wrench], system.p_default)
    q = configuration(system, state, x, z)
    efforts = np.zeros(system.nv)
    efforts[list(state.inputs)] = tau
    v = x[len(state.positions) :]
    expected = direct_dynamics(system, f_ext=True)(
        q, v, efforts[list(system.independent)], on_body(system, q, frame, wrench)
    )
    a = np.array(xdot)[len(state.positions) :]
    free, _ = state.rhs(0.0, x, z, [*tau, *np.zeros(6)], system.p_default)
    assert np.abs(a - np.array(free)[len(state.positions) :]).max() > 0.01
    np.testing.assert_allclose(a, np.array(expected), rtol=1e-11, atol=1e-11)


def pushed(*acts):
    """A four-bar with Coulomb friction; what acts on a point of its coupler."""
    m = mbs.load("four_bar")
    m.add(CoulombFriction("dry", joint="j4", sliding=0.2))
    point = m.add_frame("middle", m.components["b"].at(0.3, 0.1, 0))
    for act in acts:
        m.add(act(point))
    return m.assemble()


def test_a_wrench_moves_a_loop_with_dry_friction_as_force_elements_do():
    system = pushed()
    state = minimal_state(system, drive=DriveInputs(wrenches=("middle",)))
    wrench = [2.0, -3.0, 0.0, 0.0, 0.0, 0.7]
    motors = [0.0] * len(state.inputs)
    own = moved(system, state, np.linspace(0, 0.5, 11), lambda t: [*motors, *wrench])
    other = pushed(
        lambda point: Force("force", point, force=(2.0, -3.0, 0.0)),
        lambda point: Torque("torque", point, torque=(0.0, 0.0, 0.7)),
    )
    full = mbs.simulate.run(other, 0.5, step=0.05, tolerance=1e-11, quiet=True, q0={})
    name = system.coordinates[state.positions[0]].name
    assert np.ptp(own.x[:, 0]) > 0.01
    np.testing.assert_allclose(own.x[:, 0], full[f"{name}.q"], atol=1e-9)
    np.testing.assert_allclose(own.y[:, -1], full["dry.effort"], atol=1e-8)


def test_prescribed_positions_and_accelerations_move_as_in_a_simulation():
    system = catalogue_system("puma560")
    state = minimal_state(system, drive=DriveInputs(motions=(("q2", "q"), ("q4", "a"))))
    assert state.velocities == (0, 2, 3, 4, 5)
    assert state.accelerations == (0, 2, 4, 5)
    assert state.inputs == (0, 2, 4, 5)
    assert state.efforts == (1, 3)
    efforts = {"q1": 2.0, "q3": 1.0, "q5": 0.3, "q6": 0.1}

    def inputs(t):
        law = 0.3 * casadi.sin(2 * t)
        rates = [law, casadi.jacobian(law, t), casadi.jacobian(casadi.jacobian(law, t), t)]
        return [*efforts.values(), *rates, casadi.cos(3 * t)]

    own = moved(system, state, np.linspace(0, 1, 11), inputs)
    laws = {"q2.q": lambda t: 0.3 * casadi.sin(2 * t), "q4.a": lambda t: casadi.cos(3 * t)}
    full = mbs.simulate.run(
        system, 1.0, tau=efforts, motion=laws, step=0.1, tolerance=1e-11, quiet=True
    )
    names = [system.coordinates[k].name for k in state.positions]
    expected = np.stack([full[f"{name}.q"] for name in names], axis=1)
    np.testing.assert_allclose(own.x[:, : len(names)], expected, atol=1e-8)
    drives = np.stack([full["q2.tau"], full["q4.tau"]], axis=1)
    np.testing.assert_allclose(own.y[:, -2:], drives, atol=1e-6)


def test_a_prescribed_acceleration_of_a_loop_is_that_of_hybrid_dynamics():
    system = five_bar(-9.81)
    state = minimal_state(system, drive=DriveInputs(motions=(("a1", "a"),)))
    x, z, _ = random_point(system, state)
    xdot, y = state.rhs(0.0, x, z, [3.0, 0.7], [])
    v = np.zeros(4)
    v[list(state.velocities)], v[list(state.passive)] = x[2:], np.array(y)[3:5, 0]
    q = configuration(system, state, x, z)
    a, drive, _ = hybrid_dynamics(system, ["a1"])(q, v, [0, 0, 3.0, 0], [0.7])
    assert float(xdot[2]) == 0.7
    assert float(xdot[3]) == pytest.approx(float(a[2]), rel=1e-11)
    assert float(y[-1]) == pytest.approx(float(drive), rel=1e-11)
    np.testing.assert_allclose(np.array(y)[5:7], np.array(a)[list(state.passive)], rtol=1e-9)


@pytest.mark.parametrize("name", ["bricard", "four_bar"])
def test_the_acceleration_that_a_loop_has_anyway_needs_no_drive(name):
    """One of them has rows whose independence changes with the configuration."""
    system = catalogue_system(name)
    first = system.independent[0]
    motion = ((system.velocity_coordinates[first].name, "a"),)
    free, driven = (minimal_state(system, drive=DriveInputs(motions=m)) for m in ((), motion))
    x, z, _ = random_point(system, free)
    efforts = {k: 0.5 for k in free.inputs if k != first}
    u = [efforts.get(k, 0.0) for k in free.inputs]
    xdot, _ = free.rhs(0.0, x, z, u, system.p_default)
    a = float(xdot[len(free.positions)])
    again, y = driven.rhs(0.0, x, z, [*efforts.values(), a], system.p_default)
    assert abs(a) > 1e-3
    np.testing.assert_allclose(np.array(again), np.array(xdot), rtol=1e-10, atol=1e-10)
    assert abs(float(y[-1])) < 1e-10
    _, y = driven.rhs(0.0, x, z, [*efforts.values(), a + 1.0], system.p_default)
    assert abs(float(y[-1])) > 1e-4


def test_the_start_is_the_assembled_configuration_at_rest():
    system = five_bar(-9.81)
    state = minimal_state(system)
    x, z = start_of(system, state)
    q = configuration(system, state, x, z)
    np.testing.assert_array_equal(q, system.configuration)
    assert np.array_equal(x[2:], [0, 0])
    after, residual = state.closure(x, z, [])
    assert float(residual) < 1e-12
    np.testing.assert_allclose(np.array(after)[:, 0], z, atol=1e-12)


def ball():
    m = Mechanism("ball")
    m.connect(m.world, Spherical("s"), m.add(Box("b", length=0.4, width=0.1, density=1000)).left)
    return m.assemble()


@pytest.mark.parametrize(
    ("build", "drive", "message"),
    [
        (floating, {"wrenches": ("tips",)}, "no frame 'tips'.*did you mean 'tip'"),
        (floating, {"wrenches": ("tip", "tip")}, "wrenches name 'tip' twice"),
        (floating, {"wrenches": ("base",)}, "'base' is fixed to the base"),
        (stick_slip, {"motions": (("pull", "v"),)}, "given by 'v'; use 'q'"),
        (stick_slip, {"motions": (("pul", "a"),)}, "'pul' is no independent joint.*'pull'"),
        (stick_slip, {"motions": (("pull", "a"), ("pull", "q"))}, "motions name 'pull' twice"),
        (stopped_rocker, {"motions": (("a1", "q"),)}, "prescribe its acceleration a1.a"),
        (stopped_rocker, {"motions": (("a2", "a"),)}, "'a2' is no independent joint.*a1"),
        (stopped_rocker, {"motions": (("a1", "a"),)}, "prescribed move b1 through the loops"),
        (ball, {"motions": (("s.wx", "q"),)}, "s.wx is a velocity of a quaternion joint"),
    ],
)
def test_what_does_not_fit_is_refused(build, drive, message):
    with pytest.raises(ModelError, match=message):
        minimal_state(build(), drive=DriveInputs(**drive))
