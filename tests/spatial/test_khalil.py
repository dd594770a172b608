"""Khalil parameters: the formula of the paper, and the way back from any pose."""

import casadi
import numpy as np
import pytest
from casadi import DM, SX
from hypothesis import given, settings
from hypothesis import strategies as st
from support.random_trees import random_rotation

from mbs.spatial import Khalil, Pose, frames_to

angles = st.one_of(
    st.floats(-3.1, 3.1), st.sampled_from([k * np.pi / 2 for k in range(-2, 3)]), st.just(1e-4)
)
lengths = st.one_of(st.just(0.0), st.floats(-2, 2).filter(lambda x: x == 0 or abs(x) > 1e-3))


def turn(axis, angle):
    c, s = np.cos(angle), np.sin(angle)
    T = np.eye(4)
    k, h = {"x": (1, 2), "z": (0, 1)}[axis]
    T[k, k], T[k, h], T[h, k], T[h, h] = c, -s, s, c
    return T


def slide(axis, distance):
    T = np.eye(4)
    T["xyz".index(axis), 3] = distance
    return T


def formula(gamma, b, alpha, d, theta, r):
    return (
        turn("z", gamma)
        @ slide("z", b)
        @ turn("x", alpha)
        @ slide("x", d)
        @ turn("z", theta)
        @ slide("z", r)
    )


def numbers(matrix):
    return DM(matrix).full()


def frame(*values):
    return Khalil(*(SX(v) for v in values))


six = st.tuples(angles, lengths, angles, lengths, angles, lengths)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(six)
def test_formula(values):
    np.testing.assert_allclose(numbers(frame(*values).pose().matrix), formula(*values), atol=1e-8)


def matrix_of(frames):
    """The transform of frames one after the other, by the formula of the paper."""
    T = np.eye(4)
    for one in frames:
        T = T @ formula(*(float(x) for x in one.parameters))
    return T


@settings(max_examples=300, deadline=None, derandomize=True)
@given(six, st.sampled_from([0.1, 1.0, 10.0]))
def test_placed_gives_the_pose_back(values, size):
    frames = frames_to(frame(*values).pose(), size)
    np.testing.assert_allclose(matrix_of(frames), formula(*values), atol=1e-13)
    for one in frames:
        assert max(abs(float(one.b)), abs(float(one.r))) <= 3 * size + 6


@pytest.mark.parametrize("seed", range(30))
def test_of_any_pose(seed):
    rng = np.random.default_rng(seed)
    R, p = random_rotation(rng), rng.uniform(-2, 2, 3)
    frames = frames_to(Pose(SX(DM(R)), SX(DM(p))), 2.0)
    T = matrix_of(frames)
    np.testing.assert_allclose(T[:3, :3], R, atol=2e-15)
    np.testing.assert_allclose(T[:3, 3], p, atol=1e-14)


TILTS = [0.0, *(10.0**-k for k in range(1, 16))]


@pytest.mark.parametrize("tilt", [*TILTS, *(-tilt for tilt in TILTS), np.pi - 1e-7])
@pytest.mark.parametrize("axis", "xy")
def test_axes_that_are_nearly_parallel(tilt, axis):
    """The pose is exact to its last digits, and no frame stands far away."""
    c, s = np.cos(tilt), np.sin(tilt)
    about_x, about_y = [[1, 0, 0], [0, c, -s], [0, s, c]], [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    R = np.array(about_x if axis == "x" else about_y) @ formula(0.3, 0, 0, 0, 0, 0)[:3, :3]
    p = np.array([0.1, 0.2, 0.3])
    frames = frames_to(Pose(SX(DM(R)), SX(DM(p))), 0.4)
    T = matrix_of(frames)
    np.testing.assert_allclose(T[:3, :3], R, rtol=0, atol=1.1e-14)
    np.testing.assert_allclose(T[:3, 3], p, rtol=0, atol=1e-14)
    assert max(abs(float(x)) for one in frames for x in (one.b, one.d, one.r)) <= 3 * 0.4
    R_of_frames = numbers(frames[-1].pose().R)
    np.testing.assert_allclose(R_of_frames.T @ R_of_frames, np.eye(3), rtol=0, atol=1e-15)


def test_a_shift_across_is_one_screw_along_y():
    first, second = frames_to(frame(0, 0, 1e-6, 0, 0, 0).pose().at(SX(DM([0.1, 0.2, 0.3]))), 1.0)
    turn, across, along = first.fixed
    assert (across.axis, float(across.t)) == (1, 0.2)
    assert turn.rotation.s.is_zero()
    assert float(turn.t) == 0.3
    assert along.t.is_zero()
    moved, left = first.split()
    np.testing.assert_allclose(matrix_of([moved, left]), matrix_of([first]), atol=1e-16)
    assert left.b.is_zero()
    assert float(second.alpha) == 1e-6


@pytest.mark.parametrize("up", [1, -1])
@pytest.mark.parametrize(
    "p", [(0, 0, 0), (0, 0, 2), (1.5, 0, 0), (-1.5, 0, 3), (0, 2, 1), (0.3, -0.4, 5)]
)
def test_parallel_axes_have_no_b(up, p):
    R = np.array([[0.6, -0.8 * up, 0], [0.8, 0.6 * up, 0], [0, 0, up]])
    (back,) = frames_to(Pose(SX(DM(R)), SX(DM(np.array(p, dtype=float)))), 1.0)
    assert back.b.is_zero()
    assert float(back.alpha) == (0.0 if up > 0 else np.pi)
    assert abs(float(back.d)) == pytest.approx(np.hypot(p[0], p[1]), abs=1e-15)
    assert float(back.r) == pytest.approx(up * p[2])
    T = numbers(back.pose().matrix)
    np.testing.assert_allclose(T[:3, :3], R, atol=1e-15)
    np.testing.assert_allclose(T[:3, 3], p, atol=1e-15)


def test_intersecting_axes_have_no_d():
    given_ = frame(0.4, 0.7, 1.1, 0.0, -0.3, 0.0)
    (back,) = frames_to(given_.pose(), 1.0)
    assert [float(x) for x in back.parameters] == pytest.approx(
        [0.4, 0.7, 1.1, 0, -0.3, 0], abs=1e-13
    )
    assert back.d.is_zero()
    assert back.r.is_zero()


@pytest.mark.parametrize("alpha", [np.pi / 2, -np.pi / 2])
def test_orthogonal_axes_stay_exact(alpha):
    (back,) = frames_to(frame(0, 0.2, alpha, 0.5, np.pi / 2, 0.3).pose(), 1.0)
    assert [float(x) for x in back.parameters] == pytest.approx(
        [0, 0.2, alpha, 0.5, np.pi / 2, 0.3], abs=1e-15
    )
    assert set(np.unique(numbers(back.pose().R))) <= {-1.0, 0.0, 1.0}


def test_parameters_of_a_table_are_found_again():
    for values in ((0.3, 0.1, 0.8, 0.5, 0.2, -0.4), (-1.2, 0.0, -2.2, 0.5, 3.0, 0.4)):
        (back,) = frames_to(frame(*values).pose(), 1.0)
        assert [float(x) for x in back.parameters] == pytest.approx(values, abs=1e-14)


def at(value, symbols, values):
    return np.array(casadi.Function("f", symbols, [value])(*values))


LAYOUTS = [
    lambda L, h: Pose.translation(casadi.vertcat(L, 0, 0)),
    lambda L, h: Pose.translation(casadi.vertcat(0, L, 0)),
    lambda L, h: Pose.translation(casadi.vertcat(0, 0, L)),
    lambda L, h: Pose.translation(casadi.vertcat(L, h, 0)),
    lambda L, h: Pose.translation(casadi.vertcat(L, h, 0.4)),
    lambda L, h: (
        Pose.translation(casadi.vertcat(L, 0, h))
        @ Pose.rotation(SX(DM([[1, 0, 0], [0, 0, -1], [0, 1, 0]])))
    ),
    lambda L, h: (
        Pose.translation(casadi.vertcat(L, h, h))
        @ Pose.rotation(SX(DM([[0, 0, 1], [1, 0, 0], [0, 1, 0]])))
    ),
    lambda L, h: (
        Pose.translation(casadi.vertcat(h, 0.2, -L)) @ frame(0.3, 0, 0.7, 0, 0.1, 0).pose()
    ),
    lambda L, h: frame(0.3, 0, 0.7, 0, 0.1, 0).pose() @ Pose.translation(casadi.vertcat(h, L, -L)),
    lambda L, h: Khalil(SX(0.2), L, h, 2 * L, SX(0.4), h).pose(),
    lambda L, h: Khalil(h, L, h, 2 * L, L, h).pose(),
    lambda L, h: Pose.about("z", SX(0.4)) @ Pose.about("x", L) @ Pose.about("z", SX(-2.0)),
    lambda L, h: (
        Pose.about("y", L) @ Pose.translation(casadi.vertcat(h, 0.1, L)) @ Pose.about("y", -L)
    ),
    lambda L, h: (
        Pose.about("x", L) @ Pose.translation(casadi.vertcat(h, 0.1, L)) @ Pose.about("x", -L)
    ),
    lambda L, h: Pose.about("y", L) @ Pose.about("x", h) @ Pose.about("y", SX(0.3) + L),
    lambda L, h: (
        Pose.about("z", L) @ Pose.translation(casadi.vertcat(h, L, 0.3)) @ Pose.about("z", h)
    ),
    lambda L, h: (
        frame(0.3, 0.1, 0.7, 0, 0.1, 0).pose()
        @ Pose.translation(casadi.vertcat(L, h, h))
        @ Pose.about("x", h)
        @ frame(0.3, 0.1, -2.7, 0, 0.1, 0).pose()
    ),
    lambda L, h: (
        frame(0.3, 0.1, 0.7, 0, 0.1, 0).pose()
        @ Khalil(h, L, h, 2 * L, L, h).pose()
        @ frame(0.3, 0.1, -2.7, 0, 0.1, 0).pose().inverse()
    ),
]


@pytest.mark.sweep
@pytest.mark.parametrize("layout", LAYOUTS, ids=range(len(LAYOUTS)))
@pytest.mark.parametrize("values", [(0.7, 0.4), (0.7, -0.4), (-0.7, 0.4), (0.0, 0.4), (0.0, 0.0)])
def test_symbolic_lengths_and_angles(layout, values):
    L, h = SX.sym("L"), SX.sym("h")
    pose = layout(L, h)
    back = Pose.identity()
    for one in frames_to(pose, 1.0):
        back = back @ one.pose()
    np.testing.assert_allclose(
        at(back.matrix, [L, h], values), at(pose.matrix, [L, h], values), atol=1e-14
    )


def test_a_symbolic_length_stays_a_symbol():
    L = SX.sym("L")
    (back,) = frames_to(Pose.translation(casadi.vertcat(L, 0, 0)), 1.0)
    assert casadi.is_equal(back.d, L)
    assert all(x.is_zero() for x in (back.gamma, back.b, back.alpha, back.theta, back.r))
    (up,) = frames_to(Pose.translation(casadi.vertcat(0, 0, L)), 1.0)
    assert casadi.is_equal(up.r, L)


def test_angles_of_a_chain_are_read_off_as_they_were_written():
    al = SX.sym("al")
    pose = Pose.about("z", SX(0.3)) @ Pose.about("x", al) @ Pose.about("z", SX(-0.2))
    (one,) = frames_to(pose, 1.0)
    assert casadi.is_equal(one.alpha, al)
    assert (float(one.gamma), float(one.theta)) == (0.3, -0.2)
    behind = (
        frame(0.1, 0.2, 0.0, 0.0, 0.4, 0.0).pose()
        @ Khalil(*(SX(x) for x in (0, 0.1, 0, 0.3, 0, 0))).pose()
    )
    (one,) = frames_to(behind @ Pose.about("x", al), 1.0)
    assert casadi.is_equal(one.alpha, al)


def test_a_pose_that_symbols_turn_without_a_chain_is_refused():
    al = SX.sym("al")
    R = Pose.about("x", al).R
    with pytest.raises(ValueError, match="chain of rotations"):
        frames_to(Pose.rotation(R), 1.0)


def test_no_derivative_by_a_symbol_is_undefined():
    """At zero as well, where two axes become parallel and an arc tangent has none."""
    al, L, h = (SX.sym(name) for name in ("al", "L", "h"))
    for pose in (
        Pose.translation(casadi.vertcat(L, h, 0.1)) @ Pose.about("y", al),
        Pose.translation(casadi.vertcat(L, h, 0.1)),
        Pose.about("y", al) @ Pose.about("x", L) @ Pose.translation(casadi.vertcat(L, h, al)),
    ):
        p = casadi.vertcat(al, L, h)
        six = casadi.vertcat(*(casadi.vertcat(*one.parameters) for one in frames_to(pose, 1.0)))
        J = casadi.Function("J", [p], [casadi.jacobian(six, p)])
        assert J([0, 0, 0]).is_regular()


def test_turned_and_slid():
    moved = frame(0.1, 0.2, 0.3, 0.4, 0.5, 0.6).rotate(SX(1.0)).shift(SX(2.0))
    np.testing.assert_allclose(
        numbers(moved.pose().matrix), formula(0.1, 0.2, 0.3, 0.4, 1.5, 2.6), atol=1e-15
    )
    assert numbers(Khalil.identity().pose().matrix).tolist() == np.eye(4).tolist()


def test_poses_compose_and_invert():
    rng = np.random.default_rng(5)
    A, B = (Pose(SX(DM(random_rotation(rng))), SX(DM(rng.uniform(-1, 1, 3)))) for _ in range(2))
    np.testing.assert_allclose(
        numbers((A @ B).matrix), numbers(A.matrix) @ numbers(B.matrix), atol=1e-14
    )
    np.testing.assert_allclose(numbers((A @ A.inverse()).matrix), np.eye(4), atol=1e-14)
    assert Pose.identity().is_identity()
    assert not A.is_identity()
    assert not Pose.translation(casadi.vertcat(SX.sym("L"), 0, 0)).is_identity()
