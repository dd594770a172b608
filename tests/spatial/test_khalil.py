"""Khalil parameters: the formula of the paper, and the way back from any pose."""

import casadi
import numpy as np
import pytest
from casadi import DM, SX
from hypothesis import given, settings
from hypothesis import strategies as st
from support.random_trees import random_rotation

from mbs.spatial import Khalil, Pose

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


@settings(max_examples=300, deadline=None, derandomize=True)
@given(six)
def test_of_pose_gives_the_pose_back(values):
    T = formula(*values)
    wanted = frame(*values).pose()
    back = Khalil.of_pose(wanted)
    # axes that are nearly parallel put the common perpendicular far away, which costs digits
    far = max(1.0, abs(float(back.b)), abs(float(back.r)))
    np.testing.assert_allclose(numbers(back.pose().matrix), T, atol=1e-8 * far)


@pytest.mark.parametrize("seed", range(30))
def test_of_any_pose(seed):
    rng = np.random.default_rng(seed)
    R, p = random_rotation(rng), rng.uniform(-2, 2, 3)
    back = Khalil.of_pose(Pose(SX(DM(R)), SX(DM(p))))
    T = numbers(back.pose().matrix)
    np.testing.assert_allclose(T[:3, :3], R, atol=1e-13)
    np.testing.assert_allclose(T[:3, 3], p, atol=1e-12)


@pytest.mark.parametrize("up", [1, -1])
@pytest.mark.parametrize(
    "p", [(0, 0, 0), (0, 0, 2), (1.5, 0, 0), (-1.5, 0, 3), (0, 2, 1), (0.3, -0.4, 5)]
)
def test_parallel_axes_have_no_b(up, p):
    R = np.array([[0.6, -0.8 * up, 0], [0.8, 0.6 * up, 0], [0, 0, up]])
    back = Khalil.of_pose(Pose(SX(DM(R)), SX(DM(np.array(p, dtype=float)))))
    assert back.b.is_zero()
    assert float(back.alpha) == (0.0 if up > 0 else np.pi)
    assert abs(float(back.d)) == pytest.approx(np.hypot(p[0], p[1]), abs=1e-15)
    assert float(back.r) == pytest.approx(up * p[2])
    T = numbers(back.pose().matrix)
    np.testing.assert_allclose(T[:3, :3], R, atol=1e-15)
    np.testing.assert_allclose(T[:3, 3], p, atol=1e-15)


def test_intersecting_axes_have_no_d():
    given_ = frame(0.4, 0.7, 1.1, 0.0, -0.3, 0.0)
    back = Khalil.of_pose(given_.pose())
    assert [float(x) for x in back.parameters] == pytest.approx(
        [0.4, 0.7, 1.1, 0, -0.3, 0], abs=1e-13
    )
    assert back.d.is_zero()
    assert back.r.is_zero()


@pytest.mark.parametrize("alpha", [np.pi / 2, -np.pi / 2])
def test_orthogonal_axes_stay_exact(alpha):
    back = Khalil.of_pose(frame(0, 0.2, alpha, 0.5, np.pi / 2, 0.3).pose())
    assert [float(x) for x in back.parameters] == pytest.approx(
        [0, 0.2, alpha, 0.5, np.pi / 2, 0.3], abs=1e-15
    )
    assert set(np.unique(numbers(back.pose().R))) <= {-1.0, 0.0, 1.0}


def test_parameters_of_a_table_are_found_again():
    for values in ((0.3, 0.1, 0.8, 0.5, 0.2, -0.4), (-1.2, 0.0, -2.2, 0.5, 3.0, 0.4)):
        back = Khalil.of_pose(frame(*values).pose())
        assert [float(x) for x in back.parameters] == pytest.approx(values, abs=1e-14)


def at(value, symbols, values):
    return np.array(casadi.Function("f", symbols, [value])(*values))


LAYOUTS = [
    lambda L, h: Pose.moved(casadi.vertcat(L, 0, 0)),
    lambda L, h: Pose.moved(casadi.vertcat(0, L, 0)),
    lambda L, h: Pose.moved(casadi.vertcat(0, 0, L)),
    lambda L, h: Pose.moved(casadi.vertcat(L, h, 0)),
    lambda L, h: Pose.moved(casadi.vertcat(L, h, 0.4)),
    lambda L, h: (
        Pose.moved(casadi.vertcat(L, 0, h))
        @ Pose.turned(SX(DM([[1, 0, 0], [0, 0, -1], [0, 1, 0]])))
    ),
    lambda L, h: (
        Pose.moved(casadi.vertcat(L, h, h)) @ Pose.turned(SX(DM([[0, 0, 1], [1, 0, 0], [0, 1, 0]])))
    ),
    lambda L, h: Pose.moved(casadi.vertcat(h, 0.2, -L)) @ frame(0.3, 0, 0.7, 0, 0.1, 0).pose(),
    lambda L, h: frame(0.3, 0, 0.7, 0, 0.1, 0).pose() @ Pose.moved(casadi.vertcat(h, L, -L)),
    lambda L, h: Khalil(SX(0.2), L, h, 2 * L, SX(0.4), h).pose(),
    lambda L, h: Khalil(h, L, h, 2 * L, L, h).pose(),
]


@pytest.mark.parametrize("layout", LAYOUTS, ids=range(len(LAYOUTS)))
@pytest.mark.parametrize("values", [(0.7, 0.4), (0.7, -0.4), (-0.7, 0.4)])
def test_symbolic_lengths_and_angles(layout, values):
    L, h = SX.sym("L"), SX.sym("h")
    pose = layout(L, h)
    back = Khalil.of_pose(pose).pose()
    np.testing.assert_allclose(
        at(back.matrix, [L, h], values), at(pose.matrix, [L, h], values), atol=1e-14
    )


def test_a_symbolic_length_stays_a_symbol():
    L = SX.sym("L")
    back = Khalil.of_pose(Pose.moved(casadi.vertcat(L, 0, 0)))
    assert casadi.is_equal(back.d, L)
    assert all(x.is_zero() for x in (back.gamma, back.b, back.alpha, back.theta, back.r))
    up = Khalil.of_pose(Pose.moved(casadi.vertcat(0, 0, L)))
    assert casadi.is_equal(up.r, L)


def test_turned_and_slid():
    moved = frame(0.1, 0.2, 0.3, 0.4, 0.5, 0.6).turned(SX(1.0)).slid(SX(2.0))
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
    assert not Pose.moved(casadi.vertcat(SX.sym("L"), 0, 0)).is_identity()
