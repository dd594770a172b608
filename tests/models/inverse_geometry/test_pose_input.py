"""Poses as a user gives them: what is taken, what is rounded, and what a refusal says."""

import casadi
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.random_trees import random_rotation

from mbs.errors import ModelError
from mbs.models.inverse_geometry.chain import target_pose, target_poses
from mbs.spatial import Pose


@pytest.fixture(scope="module")
def system():
    return catalogue_system("puma560")


def pose(seed=0):
    rng = np.random.default_rng(seed)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = random_rotation(rng), rng.uniform(-1, 1, 3)
    return T


def changed(row, column, value, T=None):
    T = pose() if T is None else T
    T[row, column] = value
    return T


@pytest.mark.parametrize(
    "form",
    [
        np.array,
        np.ndarray.tolist,
        casadi.DM,
        casadi.SX,
        lambda T: Pose(casadi.SX(T[:3, :3]), casadi.SX(T[:3, 3])),
        lambda T: tuple(tuple(row) for row in T),
    ],
)
def test_forms_of_a_pose(system, form):
    np.testing.assert_allclose(target_pose(system, form(pose())), pose(), atol=1e-15)


def test_integers_are_numbers(system):
    T = [[0, -1, 0, 2], [1, 0, 0, 3], [0, 0, 1, 4], [0, 0, 0, 1]]
    np.testing.assert_array_equal(target_pose(system, T), T)


@pytest.mark.parametrize("seed", range(5))
def test_rounded_to_the_nearest_rotation(system, seed):
    """The singular value decomposition gives the same."""
    noise = np.random.default_rng(seed).uniform(-4e-7, 4e-7, (3, 3))
    T = pose(seed)
    T[:3, :3] += noise
    U, _, V = np.linalg.svd(T[:3, :3])
    found = target_pose(system, T)
    np.testing.assert_allclose(found[:3, :3], U @ V, atol=1e-15)
    np.testing.assert_array_equal(found[:, 3], T[:, 3])
    assert np.abs(found - T).max() > 1e-8


SHEARED = np.array([[1, 0.3, 0, 0], [0, np.sqrt(0.91), 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


@pytest.mark.parametrize(
    ("T", "message"),
    [
        (np.eye(3), r"of shape \(3, 3\); give a pose, \(4, 4\)"),
        (np.eye(4)[None], r"of shape \(1, 4, 4\)"),
        ("here", r"T is 'here'; give a pose"),
        (None, r"T is None"),
        ([[1, 2], [3]], r"T is \[\[1, 2\], \[3\]\]; give"),
        (casadi.SX.sym("T", 4, 4), r"T is SX.*; give a pose"),
        (1j * np.eye(4), r"T is array.*; give a pose"),
        (changed(1, 2, np.nan), r"T\[1, 2\] is nan \(row 2, column 3\)"),
        (changed(2, 3, -np.inf), r"T\[2, 3\] is -inf \(row 3, column 4\)"),
        (changed(3, 0, 0.5), r"last row of T is 0\.5, 0, 0, 1;"),
        (changed(3, 3, 0.0), r"last row of T is 0, 0, 0, 0;"),
        (pose() @ np.diag([1.2, 1, 1, 1]), r"the x axis of T, column 1, has length 1\.2;"),
        (pose() @ np.diag([1, 1, 0, 1]), r"the z axis of T, column 3, has length 0;"),
        (pose() @ np.diag([1, 1, 1 + 3e-6, 1]), r"z axis of T, column 3, has length 1\.000003;"),
        (changed(0, 1, 1e300, np.eye(4)), r"the y axis of T, column 2, has length"),
        (pose() @ SHEARED, r"x and y axes of T are not perpendicular, the cosine .* is 0\.3;"),
        (pose() @ np.diag([1, 1, -1, 1]), r"axes of T are left-handed"),
        (-np.eye(4) + np.diag([0, 0, 0, 2]), r"axes of T are left-handed"),
    ],
)
def test_refusals_name_the_row_or_axis(system, T, message):
    with pytest.raises(ModelError, match=message) as caught:
        target_pose(system, T)
    assert str(caught.value).startswith("puma560: ")
    assert "\n" not in str(caught.value)


def test_many_poses_are_rounded_as_one(system):
    T = np.array([pose(seed) for seed in range(20)])
    T[:, :3, :3] += np.random.default_rng(1).uniform(-4e-7, 4e-7, (20, 3, 3))
    alone = [target_pose(system, one) for one in T]
    np.testing.assert_allclose(target_poses(system, T), alone, atol=1e-16)
    np.testing.assert_array_equal(target_poses(system, list(T)), target_poses(system, T))
    assert target_poses(system, np.zeros((0, 4, 4))).shape == (0, 4, 4)
    assert target_poses(system, []).shape == (0, 4, 4)


@pytest.mark.parametrize(
    ("T", "message"),
    [
        ([pose(), pose(), changed(0, 0, np.nan)], r"pose 2 of 3, counted from 0: T\[0, 0\] is nan"),
        (np.array([pose(), 2 * pose()]), r"pose 1 of 2, counted from 0: the last row of T is 0"),
        ([pose(), np.eye(3)], r"pose 1 of 2, counted from 0: it is array"),
        ([pose(), "there"], r"pose 1 of 2, counted from 0: it is 'there'"),
        (pose(), r"the poses are .* of shape \(4, 4\); give them as \(N, 4, 4\)"),
        ("there", r"the poses are 'there'; give them"),
        (None, r"the poses are None"),
    ],
)
def test_refusals_of_many_name_the_first_bad_pose(system, T, message):
    with pytest.raises(ModelError, match=message):
        target_poses(system, T)
