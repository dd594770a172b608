"""All complex configurations of arms of six joints: their number, and what is certified."""

import numpy as np
import pytest
from support.random_trees import random_rotation

from mbs.closed_forms.arm import Arm
from mbs.closed_forms.arm_certificate import (
    certified_arm,
    certified_configurations,
    certified_roots,
    complex_candidates,
)
from mbs.closed_forms.arm_search import general, general_of

HALF = np.pi / 2
WRIST = [(0.3, 0.7, 0.1), (0.4, 1.1, 0.15), (0.2, -0.9, 0.3), (0, HALF, 0), (0, -HALF, 0)]
ORTHOGONAL = [(0.3, HALF, 0.1), (0.4, HALF, 0.15), (0.2, HALF, 0.3), (0.1, HALF, 0.2), (0.3, 0, 0)]


def random_arm(seed, kinds):
    """An arm of revolute and prismatic joints with random gaps."""
    rng = np.random.default_rng(seed)
    gaps = np.tile(np.eye(4), (7, 1, 1))
    for gap in gaps:
        gap[:3, :3], gap[:3, 3] = random_rotation(rng), rng.uniform(-1, 1, 3)
    return Arm(tuple("abcdef"), np.array([kind == "P" for kind in kinds]), gaps)


def distal_arm(rows):
    """An arm of revolute joints from distances, twists and offsets of its links."""
    gaps = [np.eye(4)]
    for d, alpha, r in [*rows, (0, 0, 1)]:
        c, s = np.cos(alpha), np.sin(alpha)
        gaps.append(np.array([[1, 0, 0, d], [0, c, -s, 0], [0, s, c, r], [0, 0, 0, 1.0]]))
    return Arm(tuple("abcdef"), np.zeros(6, bool), np.array(gaps))


def complex_pose(arm, q):
    """(4, 4) at complex positions, by the products that define it."""
    T = arm.gaps[0].astype(complex)
    for x, prismatic, gap in zip(q, arm.prismatic, arm.gaps[1:], strict=True):
        Z = np.eye(4, dtype=complex)
        if prismatic:
            Z[2, 3] = x
        else:
            Z[:2, :2] = [[np.cos(x), -np.sin(x)], [np.sin(x), np.cos(x)]]
        T = T @ Z @ gap
    return T


@pytest.mark.parametrize(
    ("kinds", "count"),
    [("RRRRRR", 16), ("RRPRRR", 16), ("RPRRPR", 8), ("PPRRRR", 8), ("PRPRPR", 2)],
)
def test_every_complex_configuration_is_certified(kinds, count):
    arm = random_arm(3, kinds)
    known, rng = certified_arm(general_of(arm)), np.random.default_rng(4)
    assert known.count == count
    T = arm.pose(rng.uniform(-2, 2, 6))
    roots = certified_roots(arm, T, complex_candidates(known.general.prepared, T))
    assert len(roots.q) == count
    for q in roots.q:
        own = np.where(arm.prismatic, q * _unit(arm), q)
        np.testing.assert_allclose(complex_pose(arm, own), T, atol=1e-7)
    found = certified_configurations(known, T)
    assert found.complete
    assert found.proof.endswith(f"certified: {count} of {count} roots")
    assert len(found.values) == np.sum(roots.real) == len(general(known.general, T))


def _unit(arm):
    return np.sum(np.linalg.norm(arm.gaps[1:6, :3, 3], axis=1))


@pytest.mark.parametrize(("rows", "count"), [(WRIST, 8), (ORTHOGONAL, 16)])
def test_special_arms(rows, count):
    """Where the axes of a wrist meet two configurations share every angle of the arm."""
    arm = distal_arm(rows)
    known = certified_arm(general_of(arm))
    assert known.count == count
    found = certified_configurations(known, arm.pose(np.array([0.3, -0.8, 1.1, 0.4, -1.2, 0.7])))
    assert found.complete


def test_where_two_configurations_meet_they_count_twice():
    arm = random_arm(1, "RRRRRR")
    known, q = certified_arm(general_of(arm)), np.array([0.3, -0.8, 1.1, 0.4, -1.2, 0.7])

    def at(x):
        return q + np.array([0, 0, 0, 0, x, 0])

    def slope(x):
        return np.linalg.det(arm.pose_and_jacobian(at(x))[1])

    x = np.linspace(-3, 3, 61)
    values = [slope(own) for own in x]
    k = next(k for k in range(60) if values[k] * values[k + 1] < 0)
    low, high = x[k], x[k + 1]
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if slope(middle) * slope(low) > 0 else (low, middle)
    found = certified_configurations(known, arm.pose(at(low)))
    assert found.proof.endswith("certified: 14 of 16 roots, and 2 where configurations meet")
    assert found.complete


def test_the_general_method_holds_where_many_roots_are_one():
    """Of three prismatic joints fourteen roots are at infinity: eigenvalues took no end there."""
    arm, rng = random_arm(5, "RRRPPP"), np.random.default_rng(5)
    for _ in range(7):  # as the arm was made
        random_rotation(rng), rng.uniform(-1, 1, 3)
    poses = arm.pose(rng.uniform(-3, 3, (3, 6)))
    known = certified_arm(general_of(arm))
    for T in poses:
        found = certified_configurations(known, T)
        assert (len(found.values), found.complete) == (2, True)
        assert len(general(known.general, T)) == 2
        assert np.max(arm.residual(found.values, T)) < 1e-12


def test_what_is_no_root_is_not_certified():
    arm = random_arm(2, "RRRRRR")
    T = arm.pose(np.full(6, 0.4))
    far = T.copy()
    far[:3, 3] += 100.0
    near = np.full((2, 6), 0.4 + 1e-3j)
    assert len(certified_roots(arm, T, near).q) == 1
    roots = certified_roots(arm, far, near)
    assert not np.any(roots.real)
