"""Velocities and accelerations of active, passive and cut joints, along closed motions."""

import casadi
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.closed_mechanisms import CLOSING, closed_chain, planar_loop

import mbs.models
from mbs import Mechanism
from mbs.components import Body, Coupling, Revolute
from mbs.errors import ModelError
from mbs.loops import closure_jacobian, reduction_matrix
from mbs.loops.closing import Closing, closure_parameters
from mbs.models import acceleration_closure, velocity_closure

NAMES = ["Wa", "Wp", "Wac", "Wpc", "Wc", "W", "G"]
CASES = [
    *(pytest.param((closed_chain, seed, kind), id=kind) for seed, kind in enumerate(CLOSING)),
    *(pytest.param((planar_loop, seed, 3 + seed % 3), id=f"planar{seed}") for seed in range(3)),
    *(pytest.param((mbs.load, name), id=name) for name in ("sr400", "five_bar")),
]


@pytest.fixture(params=CASES)
def system(request):
    make, *arguments = request.param
    made = make(*arguments)
    if make is mbs.load:
        return made.assemble()
    mechanism, guess = made
    return mechanism.assemble(guess=guess)


def matrices(system, q):
    return dict(zip(NAMES, (np.array(M) for M in velocity_closure(system)(q)), strict=True))


def along(system, v, h):
    """The closed configuration reached from the assembled one after a time h."""
    q = np.array(system.configuration)
    rate = np.array(system.qdot(q, v)).ravel()
    found = Closing(system, closure_parameters(system)).nearest(q + h * rate)
    assert found.is_closed
    return found.q


def motion(system, seed=3):
    """Independent velocities and those of the tree that follow, at the assembled configuration."""
    v_a = np.random.default_rng(seed).uniform(-1, 1, len(system.independent))
    return v_a, np.array(reduction_matrix(system)(list(system.configuration))) @ v_a


def cut_pose(system, q):
    """Frame_b of the first cut joint seen from its frame_a."""
    cut = system.cuts[0]
    ends = []
    for link, inside in ((cut.link_a, cut.pose_a), (cut.link_b, cut.pose_b)):
        place = np.array(mbs.models.transform(system, link + 1)(q))
        ends.append(place @ np.array(casadi.DM(inside.matrix)))
    return np.linalg.inv(ends[0]) @ ends[1]


def axis_system(axis):
    """Two directions across an axis; the angle about it is counted from the first."""
    u = np.cross(axis, [0.31, 0.74, -0.6])
    u = u / np.linalg.norm(u)
    return u, np.cross(axis, u)


def cut_positions(system, q):
    """Displacements and angles of the cut joint, read from the pose of its frames."""
    T = cut_pose(system, q)
    joint = system.cuts[0].edge.joint
    values = []
    for freedom in joint.freedoms:
        axis = np.array(freedom.axis)
        u, w = axis_system(axis)
        if freedom.motion.value == "prismatic":
            values.append(axis @ T[:3, 3])
        elif freedom.suffix == "phi_a":
            second = np.array(joint.axes[1])
            turned = T[:3, :3] @ second
            values.append(np.arctan2(np.cross(axis, second) @ turned, second @ turned))
        elif freedom.suffix == "phi_b":
            first = np.array(joint.axes[0])
            back = T[:3, :3].T @ first
            values.append(-np.arctan2(np.cross(axis, first) @ back, first @ back))
        else:
            values.append(np.arctan2(w @ T[:3, :3] @ u, u @ T[:3, :3] @ u))
    return np.array(values)


@pytest.mark.sweep
def test_the_rows_are_those_of_the_closure(system):
    q, closure = list(system.configuration), system.closure
    M = matrices(system, q)
    J = np.array(closure_jacobian(system)(q))[list(closure.rows)]
    np.testing.assert_allclose(M["Wa"], J[:, list(closure.independent)], atol=1e-14)
    np.testing.assert_allclose(M["Wp"], J[:, list(closure.passive)], atol=1e-14)
    assert np.abs(M["Wa"] + M["Wp"] @ M["W"]).max() < 1e-11
    np.testing.assert_allclose(M["G"], np.array(reduction_matrix(system)(q)), atol=1e-12)
    np.testing.assert_array_equal(M["Wc"], -np.eye(len(M["Wac"])))


@pytest.mark.parametrize("kind", ["revolute", "prismatic", "cylindrical", "universal", "planar"])
def test_velocities_of_the_cut_joint(kind):
    mechanism, guess = closed_chain(2, kind)
    system = mechanism.assemble(guess=guess)
    v_a, v = motion(system)
    h = 1e-5
    ahead, behind = (cut_positions(system, along(system, v, s * h)) for s in (1, -1))
    M = matrices(system, list(system.configuration))
    v_c = M["Wac"] @ v_a + M["Wpc"] @ M["W"] @ v_a
    assert v_c.shape == ahead.shape
    assert np.abs(v_c).min() > 1e-4
    np.testing.assert_allclose(v_c, (ahead - behind) / (2 * h), atol=1e-8)


def test_angular_velocity_of_a_spherical_cut_joint():
    mechanism, guess = closed_chain(5, "spherical")
    system = mechanism.assemble(guess=guess)
    v_a, v = motion(system)
    h = 1e-5
    ahead, behind = (cut_pose(system, along(system, v, s * h))[:3, :3] for s in (1, -1))
    spin = cut_pose(system, list(system.configuration))[:3, :3].T @ (ahead - behind) / (2 * h)
    M = matrices(system, list(system.configuration))
    v_c = (M["Wac"] + M["Wpc"] @ M["W"]) @ v_a
    np.testing.assert_allclose(v_c, [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-8)


@pytest.mark.sweep
def test_accelerations_are_the_rates_of_velocities(system):
    v_a, v = motion(system)
    q, h = list(system.configuration), 1e-5
    Psi, Phi, G_dot = (np.array(x) for x in acceleration_closure(system)(q, v_a))
    M, ahead, behind = (matrices(system, along(system, v, s * h)) for s in (0, 1, -1))
    v_p = M["W"] @ v_a

    def rate(name):
        return (ahead[name] - behind[name]) / (2 * h)

    scale = 1e-7 * max(1.0, np.abs(rate("G")).max())
    np.testing.assert_allclose(Psi.ravel(), rate("Wa") @ v_a + rate("Wp") @ v_p, atol=scale)
    np.testing.assert_allclose(Phi.ravel(), rate("Wac") @ v_a + rate("Wpc") @ v_p, atol=scale)
    np.testing.assert_allclose(G_dot, rate("G"), atol=scale)


@pytest.mark.sweep
def test_tree_velocities_give_the_same(system):
    v_a, v = motion(system)
    q = list(system.configuration)
    independent = acceleration_closure(system)(q, v_a)
    tree = acceleration_closure(system, "tree")(q, v)
    for one, other in zip(independent, tree, strict=True):
        np.testing.assert_allclose(np.array(one), np.array(other), atol=1e-10)


def test_accelerations_of_the_tree_close_the_loops():
    mechanism, guess = closed_chain(4, "universal")
    system = mechanism.assemble(guess=guess)
    v_a, _ = motion(system)
    q = list(system.configuration)
    Psi, _, G_dot = (np.array(x) for x in acceleration_closure(system)(q, v_a))
    M = matrices(system, q)
    a_p = -np.linalg.solve(M["Wp"], Psi.ravel())
    a = (G_dot @ v_a)[list(system.closure.passive)]
    np.testing.assert_allclose(a_p, a, atol=1e-9)
    assert np.abs(a).max() > 1e-2


def test_a_joint_has_one_velocity_wherever_the_loop_is_cut():
    def assembled(joint):
        mechanism, guess = planar_loop(7, 4)
        mechanism.cut(mechanism.components[joint])
        guess["closing"] = sum(guess.values())
        return mechanism.assemble(guess=guess)

    in_tree = assembled("closing")
    _, v = motion(in_tree)
    names = [speed.name for speed in in_tree.velocity_coordinates]
    known = dict(zip(names, v, strict=True))
    elsewhere = assembled("j2")
    M = matrices(elsewhere, list(elsewhere.configuration))
    active = np.array(
        [known.get(elsewhere.velocity_coordinates[k].name, np.nan) for k in elsewhere.independent]
    )
    assert not np.isnan(active).any()
    v_c = (M["Wac"] + M["Wpc"] @ M["W"]) @ active
    np.testing.assert_allclose(v_c, [known["j2"]], atol=1e-9)


def test_a_coupling_is_among_the_rows():
    m = Mechanism("gears")
    one, two = (m.add(Body(name, mass=1.0)) for name in ("one", "two"))
    m.connect(m.world, Revolute("j1", actuated=True), one)
    m.connect(m.world.at(1, 0, 0), Revolute("j2"), two)
    m.add(Coupling("mesh", driven="j2", driver="j1", coefficients=(0.0, -2.0)))
    M = matrices(m.assemble(), [0.0, 0.0])
    np.testing.assert_array_equal(M["W"], [[-2.0]])
    assert M["Wac"].shape == (0, 1)


def test_an_open_chain_has_no_closure():
    with pytest.raises(ModelError, match="scara: an open chain has no loops"):
        velocity_closure(catalogue_system("scara"))
    with pytest.raises(ModelError, match="scara: an open chain has no loops"):
        acceleration_closure(catalogue_system("scara"))
    with pytest.raises(ModelError, match="coordinates is 'all'"):
        acceleration_closure(catalogue_system("four_bar"), "all")
