"""Elementary displacements against dense matrices: points, wrenches, bodies."""

import numpy as np
import pytest
from casadi import DM, SX
from support.random_trees import random_rotation

from mbs.spatial import (
    FreeDisplacement,
    Inertia,
    MatrixRotation,
    PseudoInertia,
    ScrewDisplacement,
    origin,
    transform_inertia_along,
    transform_wrench_along,
)

ANGLES = (0.0, 0.7, np.pi / 2, -np.pi / 2, np.pi, -np.pi)


def numeric(value):
    return DM(value).full().squeeze()


def sx(value):
    return SX(DM(value))


def skewed(p):
    return np.array([[0, -p[2], p[1]], [p[2], 0, -p[0]], [-p[1], p[0], 0]])


def turned_about(axis, angle):
    K = skewed(np.eye(3)["xyz".index(axis)])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def spatial_inertia(J, ms, m):
    """(6, 6) of [linear; angular] momentum for [linear; angular] velocity."""
    return np.block([[m * np.eye(3), -skewed(ms)], [skewed(ms), J]])


def force_transform(R, p):
    """(6, 6) that brings [force; moment] from frame j to frame i."""
    return np.block([[R, np.zeros((3, 3))], [skewed(p) @ R, R]])


def displacements():
    for axis in "xyz":
        for angle in ANGLES:
            for t in (0.0, 0.4):
                p = t * np.eye(3)["xyz".index(axis)]
                yield ScrewDisplacement.about(axis, SX(angle), SX(t)), turned_about(axis, angle), p
    rng = np.random.default_rng(2)
    for p in (np.zeros(3), rng.uniform(-1, 1, 3), np.array([0.0, 0.3, 0.0])):
        R = random_rotation(rng)
        yield FreeDisplacement(MatrixRotation(sx(R)), sx(p)), R, p


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def test_number_of_the_axis():
    assert [ScrewDisplacement.about(axis, SX(0.3), SX(0)).axis for axis in "xyz"] == [0, 1, 2]


def test_points(rng):
    for step, R, p in displacements():
        r = rng.standard_normal(3)
        np.testing.assert_allclose(numeric(step.point(sx(r))), R @ r + p, atol=1e-15)


def test_wrenches(rng):
    for step, R, p in displacements():
        f, m = rng.standard_normal((2, 3))
        moved = step.wrench(sx(f), sx(m))
        expected = force_transform(R, p) @ np.concatenate([f, m])
        np.testing.assert_allclose(np.concatenate([*map(numeric, moved)]), expected, atol=2e-15)


def test_wrench_leaves_its_arguments_as_they_were(rng):
    f, m = (sx(x) for x in rng.standard_normal((2, 3)))
    before = numeric(f), numeric(m)
    ScrewDisplacement.about("x", SX(0.3), SX(0.5)).wrench(f, m)
    np.testing.assert_array_equal((numeric(f), numeric(m)), before)


def test_bodies(rng):
    for step, R, p in displacements():
        spread = rng.standard_normal((3, 3))
        ms, m = rng.standard_normal(3), rng.uniform(1, 2)
        second = spread @ spread.T
        J = np.trace(second) * np.eye(3) - second
        X = force_transform(R, p)
        expected = X @ spatial_inertia(J, ms, m) @ X.T
        body = step.body(Inertia(sx(J), sx(ms), SX(m)))
        got = spatial_inertia(numeric(body.J), numeric(body.ms), float(body.m))
        np.testing.assert_allclose(got, expected, atol=2e-14)
        pseudo = step.body(PseudoInertia(sx(second), sx(ms), SX(m)))
        S = numeric(pseudo.S)
        got = spatial_inertia(np.trace(S) * np.eye(3) - S, numeric(pseudo.ms), float(pseudo.m))
        np.testing.assert_allclose(got, expected, atol=2e-14)


def test_successive_displacements(rng):
    every = list(displacements())
    for chosen in ([], [3], [30, 2, -1], [-3, 17, 8, 25]):
        steps = [every[k][0] for k in chosen]
        R, p = np.eye(3), np.zeros(3)
        for k in chosen:
            R, p = R @ every[k][1], p + R @ every[k][2]
        np.testing.assert_allclose(numeric(origin(steps)), p, atol=1e-15)
        f, m = rng.standard_normal((2, 3))
        X = force_transform(R, p)
        moved = transform_wrench_along(steps, sx(f), sx(m))
        expected = X @ np.concatenate([f, m])
        np.testing.assert_allclose(np.concatenate([*map(numeric, moved)]), expected, atol=4e-15)
        J, ms = np.diag([1.0, 1.5, 2.0]), rng.standard_normal(3)
        body = transform_inertia_along(steps, Inertia(sx(J), sx(ms), SX(1.2)))
        got = spatial_inertia(numeric(body.J), numeric(body.ms), float(body.m))
        np.testing.assert_allclose(got, X @ spatial_inertia(J, ms, 1.2) @ X.T, atol=2e-14)
