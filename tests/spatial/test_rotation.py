"""Turns, their exactness at quarter turns, and the rotation of vectors and tensors."""

import casadi
import numpy as np
import pytest
from casadi import DM, SX
from support.random_trees import random_rotation

from mbs.spatial import (
    AxisRotation,
    MatrixRotation,
    align_z,
    axis_rotation,
    is_zero,
    nearest_rotation,
    sin_cos,
    skew,
    vector,
)

QUARTERS = {0: (0, 1), 1: (1, 0), 2: (0, -1), 3: (-1, 0)}


def number(value, *pairs):
    """Numbers of an SX at values of its symbols."""
    symbols, values = [s for s, _ in pairs], [v for _, v in pairs]
    return np.array(casadi.Function("f", symbols, [value])(*values))


def rodrigues(axis, angle):
    K = DM(skew(SX(DM(axis)))).full()
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


@pytest.mark.parametrize("k", range(-9, 10))
@pytest.mark.parametrize("off", [0.0, 4e-15, -4e-15])
def test_quarter_turns_are_exact(k, off):
    s, c = sin_cos(SX(k * np.pi / 2 + off))
    assert (float(s), float(c)) == QUARTERS[k % 4]


@pytest.mark.parametrize(
    "angle", [1e-8, 1e-12, np.pi / 2 - 1e-12, 0.3, -2.5, np.pi / 2 + 1e-6, 100.0]
)
def test_other_angles_are_not_rounded(angle):
    s, c = sin_cos(SX(angle))
    assert float(s) == pytest.approx(np.sin(angle), rel=1e-14, abs=1e-16)
    assert float(c) == pytest.approx(np.cos(angle), rel=1e-14, abs=1e-16)


@pytest.mark.parametrize("k", range(-5, 6))
@pytest.mark.parametrize(
    "written", ["q+k", "k+q", "k-q", "q-k", "(q+k/2)+k/2", "k+(q+q)", "k-(q-q2)"]
)
def test_quarter_turns_leave_the_constant_out_of_the_graph(k, written):
    q, q2, x, x2 = SX.sym("q"), SX.sym("q2"), 0.37, -0.9
    turn = k * np.pi / 2
    forms = {
        "q+k": lambda q, q2: q + turn,
        "k+q": lambda q, q2: turn + q,
        "k-q": lambda q, q2: turn - q,
        "q-k": lambda q, q2: q - turn,
        "(q+k/2)+k/2": lambda q, q2: (q + turn / 2) + turn / 2,
        "k+(q+q)": lambda q, q2: turn + (q + q),
        "k-(q-q2)": lambda q, q2: turn - (q - q2),
    }
    s, c = sin_cos(SX(forms[written](q, q2)))
    angle = forms[written](x, x2)
    f = casadi.Function("f", [q, q2], [s, c])
    np.testing.assert_allclose(
        np.array(f(x, x2)).ravel(), [np.sin(angle), np.cos(angle)], atol=1e-15
    )
    constants = [
        f.instruction_constant(n)
        for n in range(f.n_instructions())
        if f.instruction_id(n) == casadi.OP_CONST
    ]
    assert all(abs(value) <= 2 for value in constants)
    assert not any(abs(value - abs(turn)) < 1e-9 for value in map(abs, constants) if turn)


@pytest.mark.parametrize("axis", "xyz")
def test_turns_against_matrices(axis):
    rng = np.random.default_rng(1)
    q = SX.sym("q")
    turn = axis_rotation(axis, q)
    unit = np.eye(3)["xyz".index(axis)]
    R = rodrigues(unit, 0.7)
    np.testing.assert_allclose(number(turn.matrix, (q, 0.7)), R, atol=1e-15)
    v = rng.standard_normal(3)
    np.testing.assert_allclose(number(turn.apply(SX(DM(v))), (q, 0.7)).ravel(), R @ v, atol=1e-15)
    np.testing.assert_allclose(
        number(turn.apply_inverse(SX(DM(v))), (q, 0.7)).ravel(), R.T @ v, atol=1e-15
    )
    J = rng.standard_normal((3, 3))
    J = J + J.T
    np.testing.assert_allclose(
        number(turn.apply_to_tensor(SX(DM(J))), (q, 0.7)), R @ J @ R.T, atol=1e-14
    )


def test_matrix_turn_is_the_same_as_its_matrix():
    rng = np.random.default_rng(2)
    R, v, J = random_rotation(rng), rng.standard_normal(3), np.diag([1.0, 2.0, 3.0])
    turn = MatrixRotation(SX(DM(R)))
    np.testing.assert_allclose(DM(turn.apply(SX(DM(v)))).full().ravel(), R @ v, atol=1e-15)
    np.testing.assert_allclose(
        DM(turn.apply_inverse(SX(DM(v)))).full().ravel(), R.T @ v, atol=1e-15
    )
    np.testing.assert_allclose(DM(turn.apply_to_tensor(SX(DM(J)))).full(), R @ J @ R.T, atol=1e-14)


def test_turning_a_tensor_costs_nine_multiplications():
    s, c = SX.sym("s"), SX.sym("c")
    a = [SX.sym(f"a{k}") for k in range(6)]
    J = casadi.vertcat(
        casadi.horzcat(a[0], a[1], a[2]),
        casadi.horzcat(a[1], a[3], a[4]),
        casadi.horzcat(a[2], a[4], a[5]),
    )
    f = casadi.Function("f", [s, c, *a], [AxisRotation("z", s, c).apply_to_tensor(J)])
    kinds = [f.instruction_id(n) for n in range(f.n_instructions())]
    # the double of s b is an addition or a product by two
    assert kinds.count(casadi.OP_MUL) + kinds.count(casadi.OP_TWICE) <= 10


@pytest.mark.parametrize(
    "axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0, -1, 0), (0, 0, -1)]
)
def test_align_z_of_a_coordinate_axis_has_only_coordinate_axes(axis):
    R = DM(align_z(np.array(axis, dtype=float))).full()
    assert set(np.unique(R)) <= {-1.0, 0.0, 1.0}
    np.testing.assert_array_equal(R[:, 2], axis)
    assert np.linalg.det(R) == pytest.approx(1)


def test_align_z_documented_order():
    np.testing.assert_array_equal(
        DM(align_z(np.array([1.0, 0, 0]))).full(), np.eye(3)[:, [1, 2, 0]]
    )
    np.testing.assert_array_equal(
        DM(align_z(np.array([0, 1.0, 0]))).full(), np.eye(3)[:, [2, 0, 1]]
    )
    np.testing.assert_array_equal(DM(align_z(np.array([0, 0, 1.0]))).full(), np.eye(3))


@pytest.mark.parametrize("seed", range(20))
def test_align_z_of_any_direction(seed):
    direction = np.random.default_rng(seed).standard_normal(3)
    R = DM(align_z(direction)).full()
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(R[:, 2], direction / np.linalg.norm(direction), atol=1e-15)
    assert np.linalg.det(R) == pytest.approx(1, rel=1e-14)


@pytest.mark.parametrize("noise", [1e-9, 1e-12, 3e-16])
def test_nearest_rotation_is_one_to_the_last_digit(noise):
    rng = np.random.default_rng(3)
    for axis, angle in (("x", 0.0), ("y", np.pi / 2), ("z", 0.3), ("x", 1e-11)):
        R = rodrigues(np.eye(3)["xyz".index(axis)], angle)
        made = np.array(nearest_rotation(R + noise * rng.uniform(-1, 1, (3, 3))))
        np.testing.assert_allclose(made.T @ made, np.eye(3), rtol=0, atol=1e-15)
        np.testing.assert_allclose(made, R, rtol=0, atol=2 * noise + 1e-15)


def test_a_quarter_turn_that_somebody_computed_is_one():
    R = rodrigues(np.array([0.0, 1, 0]), np.pi / 2) + 2e-16
    assert nearest_rotation(R) == ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))


def test_a_tilt_is_no_noise():
    R = rodrigues(np.array([0.0, 1, 0]), 1e-13)
    assert nearest_rotation(R)[0][2] == np.sin(1e-13)


def test_is_zero_and_skew():
    x = SX.sym("x")
    assert is_zero(SX.zeros(3, 3))
    assert not is_zero(vector([0, 0, x]))
    assert not is_zero(vector([0, 1e-30, 0]))
    a, b = np.array([1.0, -2, 3]), np.array([0.4, 5, -6])
    np.testing.assert_allclose(DM(skew(SX(DM(a)))).full() @ b, np.cross(a, b), atol=1e-15)


@pytest.mark.parametrize("angle", [0.7, 0.0, np.pi / 2, -np.pi / 2, np.pi])
@pytest.mark.parametrize("axis", "xyz")
def test_any_tensor_is_turned(axis, angle):
    turn, square = axis_rotation(axis, SX(angle)), np.random.default_rng(5).standard_normal((3, 3))
    R = rodrigues(np.eye(3)["xyz".index(axis)], angle)
    for one in (turn, MatrixRotation(turn.matrix)):
        turned = DM(one.apply_to_square(SX(DM(square)))).full()
        np.testing.assert_allclose(turned, R @ square @ R.T, atol=2e-15)


def test_turning_any_tensor_costs_twelve_multiplications_and_a_quarter_turn_none():
    s, c = SX.sym("s"), SX.sym("c")
    square = SX.sym("a", 3, 3)
    for turn, most in ((AxisRotation("y", s, c), 12), (AxisRotation("y", SX(-1), SX(0)), 0)):
        f = casadi.Function("f", [s, c, square], [turn.apply_to_square(square)])
        kinds = [f.instruction_id(n) for n in range(f.n_instructions())]
        assert kinds.count(casadi.OP_MUL) == most
        assert most or casadi.OP_ADD not in kinds
