"""Equations free of units, and corrections towards them."""

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

from mbs.models.inverse_geometry.chain import frame_chain
from mbs.models.inverse_geometry.target import Target, distinct

Q = np.array([0.3, 0.5, 0.2, 0.1, 0.4, 0.6])


def target(name="stanford", q=Q):
    arm = frame_chain(catalogue_system(name)).arm(np.zeros(0))
    return Target(arm, arm.pose(q))


def test_the_equations_vanish_at_the_pose_and_grow_as_the_jacobian_says():
    aim, step = target(), 1e-6
    x = Q / aim.unit
    e, J = aim.excess(x)
    assert np.max(np.abs(e)) < 1e-15
    for k in range(6):
        way = step * np.eye(6)[k]
        slope = (aim.excess(x + way)[0] - aim.excess(x - way)[0]) / (2 * step)
        assert slope == pytest.approx(J[:, k], abs=1e-8)


def test_units_do_not_count():
    """A robot twice as large has the same singular values."""
    small = target()
    gaps = small.arm.gaps.copy()
    gaps[:, :3, 3] *= 2
    arm = type(small.arm)(small.arm.names, small.arm.prismatic, gaps)
    q = np.where(small.arm.prismatic, 2 * Q, Q)
    large = Target(arm, arm.pose(q))
    assert large.singular_values(q) == pytest.approx(small.singular_values(Q), rel=1e-12)


def test_a_correction_solves_with_a_joint_held():
    aim = target("puma560", np.array([0.3, -0.5, 0.7, 0.4, 0.0, 0.2]))
    x = np.array([0.3, -0.5, 0.7, 0.9, 0.01, -0.2])
    found = aim.corrected(x, np.eye(6)[[3]], np.array([0.9]))
    assert aim.residual(found) < 1e-14
    assert found[3] == pytest.approx(0.9, abs=1e-14)
    assert found[5] == pytest.approx(-0.3, abs=1e-12)


def test_whole_turns_and_scattered_copies_are_one():
    q = np.array([0.3, 0.0, 0.2, -0.1])
    aim = target("scara", q)
    null = np.array([0.46875, -1.0, 0.53125, 0.0])
    same = [q, q + np.array([2 * np.pi, 0, 0, 0]), q + 2e-7 * null]
    other = [q + np.array([0.0, 0.0, 0.5, 0.0])]
    assert distinct(aim, np.array(same + other)) == [[0, 1, 2], [3]]
    assert distinct(aim, np.zeros((0, 4))) == []
