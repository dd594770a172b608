"""Inertia about other points and in other axes, against clouds of point masses."""

import casadi
import numpy as np
import pytest
from casadi import DM, SX
from support.random_trees import random_rotation

from mbs.spatial import (
    Inertia,
    MatrixRotation,
    axis_rotation,
    is_zero,
    quaternion_rate,
    quaternion_rotation,
)


def cloud(rng, n=7):
    return rng.uniform(0.1, 2, n), rng.uniform(-1, 1, (n, 3))


def of_cloud(masses, points):
    """J about the origin, first moments and mass of point masses."""
    J = sum(m * (x @ x * np.eye(3) - np.outer(x, x)) for m, x in zip(masses, points, strict=True))
    return J, masses @ points, masses.sum()


def assert_is(inertia, masses, points, atol=1e-13):
    J, ms, m = of_cloud(masses, points)
    np.testing.assert_allclose(DM(inertia.J).full(), J, atol=atol)
    np.testing.assert_allclose(DM(inertia.ms).full().ravel(), ms, atol=atol)
    assert float(inertia.m) == pytest.approx(m)


def inertia_of(masses, points):
    J, ms, m = of_cloud(masses, points)
    return Inertia(SX(DM(J)), SX(DM(ms)), SX(m))


@pytest.mark.parametrize("seed", range(5))
def test_displaced_and_turned(seed):
    rng = np.random.default_rng(seed)
    masses, points = cloud(rng)
    R, p = random_rotation(rng), rng.uniform(-1, 1, 3)
    seen = inertia_of(masses, points).seen_from(MatrixRotation(SX(DM(R))), SX(DM(p)))
    assert_is(seen, masses, points @ R.T + p)
    turned = inertia_of(masses, points).seen_from(MatrixRotation(SX(DM(R))), SX.zeros(3))
    assert_is(turned, masses, points @ R.T)


@pytest.mark.parametrize("axis", "xyz")
def test_turned_about_an_axis(axis):
    rng = np.random.default_rng(8)
    masses, points = cloud(rng)
    turn = axis_rotation(axis, SX(0.9))
    R, p = DM(turn.matrix).full(), rng.uniform(-1, 1, 3)
    assert_is(inertia_of(masses, points).seen_from(turn, SX(DM(p))), masses, points @ R.T + p)


def test_about_the_centre_of_mass():
    rng = np.random.default_rng(3)
    masses, points = cloud(rng)
    com = masses @ points / masses.sum()
    central, _, m = of_cloud(masses, points - com)
    made = Inertia.about_com(SX(m), SX(DM(com)), SX(DM(central)))
    assert_is(made, masses, points)


def test_momentum_of_a_moving_body():
    rng = np.random.default_rng(12)
    masses, points = cloud(rng)
    V, w = rng.uniform(-1, 1, (2, 3))
    linear, angular = inertia_of(masses, points).momentum(SX(DM(V)), SX(DM(w)))
    each = masses[:, None] * (V + np.cross(w, points))
    np.testing.assert_allclose(DM(linear).full().ravel(), each.sum(0), atol=1e-13)
    np.testing.assert_allclose(
        DM(angular).full().ravel(), np.cross(points, each).sum(0), atol=1e-13
    )


def test_symbolic_mass_and_centre():
    m, c = SX.sym("m"), SX.sym("c", 3)
    made = Inertia.about_com(m, c, SX(DM(np.diag([1.0, 2, 2.5]))))
    f = casadi.Function("f", [m, c], [made.J, made.ms])
    x = np.array([0.1, -0.2, 0.3])
    J, ms = f(2.0, x)
    np.testing.assert_allclose(
        np.array(J), np.diag([1.0, 2, 2.5]) + 2 * (x @ x * np.eye(3) - np.outer(x, x)), atol=1e-15
    )
    np.testing.assert_allclose(np.array(ms).ravel(), 2 * x)


def test_ten_parameters_round_trip():
    ten = SX.sym("t", 10)
    back = Inertia.from_parameters(ten).parameters
    assert back.shape == (10, 1)
    assert all(casadi.is_equal(back[k], ten[k]) for k in range(10))
    J = Inertia.from_parameters(ten).J
    assert all(casadi.is_equal(J[k, m], J[m, k]) for k in range(3) for m in range(3))


def test_sum_and_massless():
    rng = np.random.default_rng(4)
    masses, points = cloud(rng)
    whole = inertia_of(masses[:3], points[:3]) + inertia_of(masses[3:], points[3:])
    assert_is(whole, masses, points)
    assert is_zero(Inertia.zero().parameters)
    assert not is_zero(whole.parameters)
    assert not is_zero(Inertia(SX.zeros(3, 3), SX.zeros(3), SX.sym("m")).parameters)
    moved = Inertia.zero().seen_from(axis_rotation("x", SX.sym("q")), SX.sym("p", 3))
    assert is_zero(moved.parameters)


def rotation_about(axis, angle):
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def numeric(value):
    return DM(value).full()


@pytest.mark.parametrize("seed", range(5))
def test_quaternion_is_the_rotation_about_its_axis(seed):
    rng = np.random.default_rng(seed)
    axis, angle = rng.standard_normal(3), rng.uniform(-3, 3)
    axis /= np.linalg.norm(axis)
    quaternion = np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * axis])
    R = numeric(quaternion_rotation(SX(DM(quaternion))))
    np.testing.assert_allclose(R, rotation_about(axis, angle), atol=1e-14)


def test_quaternion_of_another_length_scales_the_rotation():
    quaternion = np.random.default_rng(1).standard_normal(4)
    R = numeric(quaternion_rotation(SX(DM(quaternion))))
    np.testing.assert_allclose(R.T @ R, (quaternion @ quaternion) ** 2 * np.eye(3), atol=1e-13)


@pytest.mark.parametrize("seed", range(5))
def test_quaternion_rate_is_the_angular_velocity(seed):
    rng = np.random.default_rng(seed)
    quaternion, w = rng.standard_normal(4), rng.standard_normal(3)
    quaternion /= np.linalg.norm(quaternion)
    rate = numeric(quaternion_rate(SX(DM(quaternion)), SX(DM(w)))).ravel()
    assert rate @ quaternion == pytest.approx(0, abs=1e-15)
    h = 1e-6
    now, plus, minus = (
        numeric(quaternion_rotation(SX(DM(quaternion + x * rate)))) for x in (0, h, -h)
    )
    W = now.T @ (plus - minus) / (2 * h)  # in the turned frame
    np.testing.assert_allclose([W[2, 1], W[0, 2], W[1, 0]], w, atol=1e-9)
    np.testing.assert_allclose(W, -W.T, atol=1e-9)
