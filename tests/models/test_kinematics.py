"""Jacobians, their factors, and the motion of links, each against something independent."""

import casadi
import numpy as np
import pytest
from casadi import SX
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.catalogue_systems import catalogue_system
from support.closed_mechanisms import closed_chain
from support.random_trees import ALL_KINDS, random_body, random_rotation, random_state, random_tree
from support.sweeps import examples

import mbs
import mbs.loops
import mbs.models
from mbs.components import Free, Prismatic, Revolute, Spherical
from mbs.errors import ModelError
from mbs.models import jacobian, jacobian_dot_velocity, link_accelerations, link_velocities
from mbs.recursions.link_motions import base_poses, link_poses

COMMON = dict(deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))


def drawn_tree(seed, n=5):
    return random_tree(seed, n=n, kinds=ALL_KINDS, aligned=seed % 2 == 0).mechanism.assemble()


def twist_of(T, T_rate):
    """Velocity of the origin, and angular velocity, from a pose and its time derivative."""
    W = T_rate[:3, :3] @ T[:3, :3].T
    return np.concatenate([T_rate[:3, 3], [W[2, 1], W[0, 2], W[1, 0]]])


def link_frames(system):
    """(q) -> poses of all links in the base, from the poses that other models use."""
    q = SX.sym("q", system.nq)
    poses = base_poses(system.tree, link_poses(system.tree, q))
    return casadi.Function("T", [q], [pose.matrix for pose in poses])


def rates(f, q, q_rate):
    """Outputs of f(q), and their rates for a rate of q, by automatic differentiation."""
    x = SX.sym("x", len(q))
    outputs = f.call([x])
    moving = casadi.Function("r", [x], [casadi.jtimes(o, x, casadi.DM(q_rate)) for o in outputs])
    return [np.array(o) for o in f.call([q])], [np.array(o) for o in moving.call([q])]


@settings(max_examples=examples(10), **COMMON)
@given(st.integers(0, 10**6), st.integers(0, 4), st.integers(0, 4))
def test_jacobian_in_any_axes_is_the_velocity_of_the_frame(seed, moved, axes):
    system = drawn_tree(seed)
    q, v, _ = random_state(system, np.random.default_rng(seed))
    name = system.bodies[moved % len(system.bodies)].name
    other = ["base", *(row.name for row in system.bodies)][axes]
    f = mbs.models.transform(system, name)
    (T,), (T_rate,) = rates(f, q, np.array(system.qdot(q, v)).ravel())
    R = np.array(mbs.models.transform(system, "base", relative_to=other)(q))[:3, :3]
    expected = np.kron(np.eye(2), R) @ twist_of(T, T_rate)
    J = np.array(jacobian(system, name, expressed_in=other)(q))
    np.testing.assert_allclose(J @ v, expected, rtol=0, atol=1e-10)
    R6, L, J_i = (np.array(x) for x in jacobian(system, name, other, form="renaud")(q))
    np.testing.assert_allclose(R6 @ L @ J_i, J, rtol=0, atol=1e-11)
    np.testing.assert_allclose(R6 @ R6.T, np.eye(6), rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(L), 1, rtol=0, atol=1e-12)


@pytest.mark.sweep
@pytest.mark.parametrize("intermediate", range(7))
@pytest.mark.parametrize("reference", [None, 0, 2, 6])
def test_renaud_with_any_frames(intermediate, reference):
    system = catalogue_system("puma560")
    q = np.linspace(-1, 1.5, 6)
    asked = jacobian(system, 6, form="renaud", intermediate=intermediate, reference=reference)
    R6, L, J = (np.array(x) for x in asked(q))
    whole = np.array(jacobian(system, 6)(q))
    np.testing.assert_allclose(R6 @ L @ J, whole, rtol=0, atol=1e-13)
    R = np.array(mbs.models.transform(system, intermediate)(q))[:3, :3]
    np.testing.assert_allclose(R6, np.kron(np.eye(2), R), rtol=0, atol=1e-13)


def test_jacobian_of_the_base_is_zero():
    system = catalogue_system("puma560")
    assert not np.any(np.array(jacobian(system, "base")(np.ones(6))))
    R6, L, J = jacobian(system, 0, form="renaud")(np.ones(6))
    assert not np.any(np.array(J))
    np.testing.assert_array_equal(np.array(R6), np.eye(6))
    np.testing.assert_array_equal(np.array(L), np.eye(6))


@settings(max_examples=examples(8), **COMMON)
@given(st.integers(0, 10**6))
def test_link_velocities_and_accelerations(seed):
    system = drawn_tree(seed)
    q, v, a = random_state(system, np.random.default_rng(seed))
    q_rate = np.array(system.qdot(q, v)).ravel()
    T, T_rate = rates(link_frames(system), q, q_rate)
    V = np.array(link_velocities(system)(q, v))
    Vd = np.array(link_accelerations(system)(q, v, a))
    spatial = twists_in_base(system)
    x, y = SX.sym("q", system.nq), SX.sym("v", system.nv)
    flow = casadi.vertcat(system.qdot(x, y), casadi.DM(a))
    slope = casadi.Function("s", [x, y], [casadi.jtimes(spatial(x, y), casadi.vertcat(x, y), flow)])
    accelerations = np.array(slope(q, v))
    for k in range(len(T)):
        turn = np.kron(np.eye(2), T[k][:3, :3])
        np.testing.assert_allclose(turn @ V[:, k], twist_of(T[k], T_rate[k]), rtol=0, atol=1e-9)
        np.testing.assert_allclose(turn @ Vd[:, k], accelerations[:, k], rtol=0, atol=1e-8)


def twists_in_base(system):
    """(q, v) -> (6, nl) from the Jacobian of every link."""
    q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
    columns = [
        casadi.mtimes(jacobian(system, j)(q), v) for j in range(1, len(system.tree.links) + 1)
    ]
    return casadi.Function("V", [q, v], [casadi.horzcat(*columns)])


@settings(max_examples=examples(8), **COMMON)
@given(st.integers(0, 10**6), st.integers(0, 5))
def test_jacobian_dot_velocity_is_the_derivative_of_the_jacobian(seed, axes):
    system = drawn_tree(seed)
    q, v, _ = random_state(system, np.random.default_rng(seed))
    name = system.bodies[-1].name
    other = ["base", *(row.name for row in system.bodies)][axes]
    q_rate = np.array(system.qdot(q, v)).ravel()
    _, (J_rate,) = rates(jacobian(system, name), q, q_rate)
    R = np.array(mbs.models.transform(system, "base", relative_to=other)(q))[:3, :3]
    ours = np.array(jacobian_dot_velocity(system, name, expressed_in=other)(q, v)).ravel()
    expected = np.kron(np.eye(2), R) @ J_rate @ v
    np.testing.assert_allclose(ours, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("closing", ["revolute", "spherical", "universal"])
def test_closed_system_in_independent_coordinates(closing):
    mechanism, guess = closed_chain(3, closing)
    system = mechanism.assemble(guess=guess)
    q, m = np.array(system.configuration), len(system.independent)
    v_a, a_a = np.random.default_rng(0).uniform(-1, 1, (2, m))
    G = np.array(mbs.loops.reduction_matrix(system)(q))
    name = system.bodies[-2].name
    reduced, tree = jacobian(system, name), jacobian(system, name, coordinates="tree")
    np.testing.assert_allclose(np.array(reduced(q)), np.array(tree(q)) @ G, rtol=0, atol=1e-12)
    R6, L, J = (np.array(x) for x in jacobian(system, name, form="renaud")(q))
    np.testing.assert_allclose(R6 @ L @ J, np.array(reduced(q)), rtol=0, atol=1e-12)
    q_rate = np.array(system.qdot(q, G @ v_a)).ravel()
    _, (J_rate,) = rates(reduced, q, q_rate)
    bias = np.array(jacobian_dot_velocity(system, name)(q, v_a)).ravel()
    np.testing.assert_allclose(bias, J_rate @ v_a, rtol=0, atol=1e-8)
    in_tree = jacobian_dot_velocity(system, name, coordinates="tree")(q, G @ v_a)
    _, (tree_rate,) = rates(tree, q, q_rate)
    np.testing.assert_allclose(np.array(in_tree).ravel(), tree_rate @ G @ v_a, rtol=0, atol=1e-8)
    link = system.frame(name)[0]
    R = np.array(mbs.models.transform(system, "base", relative_to=link + 1)(q))[:3, :3]
    turn = np.kron(np.eye(2), R)
    ours = np.array(link_velocities(system)(q, v_a))[:, link]
    np.testing.assert_allclose(
        ours, turn @ np.array(jacobian(system, link + 1)(q)) @ v_a, rtol=0, atol=1e-10
    )
    Vd = np.array(link_accelerations(system)(q, v_a, a_a))[:, link]
    own = np.array(jacobian(system, link + 1)(q)) @ a_a
    own += np.array(jacobian_dot_velocity(system, link + 1)(q, v_a)).ravel()
    np.testing.assert_allclose(Vd, turn @ own, rtol=0, atol=1e-8)


def carried_arm(seed, floating):
    """The same random arm on the world, or on a body that is free."""
    rng = np.random.default_rng(seed)
    mechanism = mbs.Mechanism("arm", gravity=(0, 0, -9.81))
    platform = random_body(rng, "platform")
    before = mechanism.world
    if floating:
        before = mechanism.add(platform)
        mechanism.connect(mechanism.world, Free("float"), before)
    for k, kind in enumerate((Revolute, Prismatic, Spherical, Revolute)):
        body = mechanism.add(random_body(rng, f"body{k}"))
        axis = {} if kind is Spherical else {"axis": "xyz"[k % 3]}
        place = before.at(*rng.uniform(-1, 1, 3), rotation=random_rotation(rng))
        mechanism.connect(place, kind(f"j{k}", **axis), body)
        before = body
    return mechanism.assemble()


@pytest.mark.parametrize("seed", range(3))
def test_moving_base_is_a_free_joint_with_the_same_motion(seed):
    arm, carried = carried_arm(seed, floating=False), carried_arm(seed, floating=True)
    q, v, a = random_state(carried, np.random.default_rng(seed))
    v_0 = v[:6]
    a_0 = a[:6] + np.concatenate([np.cross(v_0[3:], v_0[:3]), np.zeros(3)])
    own = q[7:], v[6:], a[6:]
    V = np.array(link_velocities(arm, moving_base=True)(*own[:2], v_0))
    whole = np.array(link_velocities(carried)(q, v))
    np.testing.assert_allclose(V, whole[:, 1:], rtol=0, atol=1e-11)
    Vd = np.array(link_accelerations(arm, moving_base=True)(*own, v_0, a_0))
    whole = np.array(link_accelerations(carried)(q, v, a))
    np.testing.assert_allclose(Vd, whole[:, 1:], rtol=0, atol=1e-10)
    at_rest = own[0], own[1], np.zeros(arm.nv)
    still = np.array(link_accelerations(arm, moving_base=True)(*at_rest, v_0, a_0))[:, -1]
    name = len(arm.tree.links)
    bias = jacobian_dot_velocity(arm, name, expressed_in=name, moving_base=True)
    ours = np.array(bias(*own[:2], v_0, a_0)).ravel()
    np.testing.assert_allclose(ours, still, rtol=0, atol=1e-11)


@pytest.mark.parametrize("robot", ["puma560", "rx90", "stanford", "scara"])
def test_pinocchio_agrees(robot):
    pin = pytest.importorskip("pinocchio")
    from crosscheck.test_pinocchio import twin

    mechanism = mbs.load(robot)
    system = mechanism.assemble()
    model, _ = twin(mechanism)
    data = model.createData()
    last = model.njoints - 1
    aligned = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    rng = np.random.default_rng(0)
    for _ in range(5):
        q, v, a = rng.uniform(-2, 2, (3, model.nv))
        pin.computeJointJacobians(model, data, q)
        J = pin.getJointJacobian(model, data, last, aligned)
        np.testing.assert_allclose(np.array(jacobian(system, last)(q)), J, rtol=0, atol=1e-12)
        for acceleration in (np.zeros(model.nv), a):
            pin.forwardKinematics(model, data, q, v, acceleration)
            local = [
                pin.getClassicalAcceleration(model, data, j, pin.ReferenceFrame.LOCAL).vector
                for j in range(1, last + 1)
            ]
            ours = np.array(link_accelerations(system)(q, v, acceleration))
            np.testing.assert_allclose(ours, np.array(local).T, rtol=0, atol=1e-11)
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        bias = pin.getClassicalAcceleration(model, data, last, aligned).vector
        ours = np.array(jacobian_dot_velocity(system, last)(q, v)).ravel()
        np.testing.assert_allclose(ours, bias, rtol=0, atol=1e-11)


def test_functions_have_names_and_are_cached():
    system = catalogue_system("rx90")
    factors = jacobian(system, 6, form="renaud")
    assert (factors.name(), factors.name_out()) == ("jacobian_renaud", ["R6", "L", "J"])
    moving = link_accelerations(system, moving_base=True)
    assert moving.name_in() == ["q", "v", "a", "v_0", "a_0"]
    bias = jacobian_dot_velocity(system, 6)
    assert (bias.name(), bias.name_in(), bias.name_out()) == ("jpqp", ["q", "v"], ["jpqp"])
    assert jacobian(system, 6, form="renaud") is factors


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"form": "short"}, "rx90: form is 'short'; use 'full' or 'renaud'"),
        ({"frame": "tol"}, "rx90: there is no frame 'tol'; "),
        ({"expressed_in": 9}, "rx90: there is no link 9; the links are 1 to 6"),
        ({"intermediate": 3}, "an intermediate frame or a reference was given; they belong to"),
        (
            {"frame": 3, "form": "renaud", "intermediate": 5},
            "link 5 is not between the base and frame 3; the links there are 0, 1, 2, 3",
        ),
        ({"form": "renaud", "reference": 7}, "there is no link 7"),
        ({"coordinates": "all"}, "coordinates is 'all'; use 'independent' or 'tree'"),
    ],
)
def test_wrong_arguments_are_refused(arguments, message):
    system = catalogue_system("rx90")
    with pytest.raises(ModelError) as refused:
        jacobian(system, **{"frame": 6, **arguments})
    assert message in str(refused.value)


def test_wrong_arguments_of_the_others_are_refused():
    system = catalogue_system("rx90")
    with pytest.raises(ModelError, match="there is no frame 'tol'"):
        jacobian_dot_velocity(system, "tol")
    with pytest.raises(ModelError, match="coordinates is 'all'"):
        link_velocities(system, coordinates="all")
    with pytest.raises(ModelError, match=r"call assemble\(\) first"):
        link_accelerations(mbs.load("rx90"))


def test_long_chain():
    count = 40
    frame = [{"antecedent": j, "joint": "revolute", "alpha": 0.3, "d": 0.1} for j in range(count)]
    body = [{"frame": j + 1, "M": 1} for j in range(count)]
    system = mbs.load({"name": "chain", "frame": frame, "body": body}).assemble()
    q = np.linspace(-1, 1, count)
    J = np.array(jacobian(system, count)(q))
    T = mbs.models.transform(system, count)
    step = 1e-6
    for k in (0, 17, 39):
        d = step * np.eye(count)[k]
        slope = (np.array(T(q + d)) - np.array(T(q - d))) / (2 * step)
        np.testing.assert_allclose(J[:, k], twist_of(np.array(T(q)), slope), rtol=0, atol=1e-8)
    R6, L, J_i = (np.array(x) for x in jacobian(system, count, form="renaud")(q))
    np.testing.assert_allclose(R6 @ L @ J_i, J, rtol=0, atol=1e-11)
