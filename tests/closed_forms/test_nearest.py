import numpy as np
import pytest
from support.plain_arms import khalil, puma, random_arm

from mbs.closed_forms.arm_search import nearest

PLANAR = khalil([(0, 0, 0, 0), (0, 1.0, 0, 0), (0, 0.5, 0, 0)])


def test_a_pose_within_reach_is_reached():
    arm = puma()
    T = arm.pose(np.array([0.4, -0.7, 0.5, 1.1, 0.8, -2.0]))
    found = nearest(arm, T)
    assert found.distance < 1e-14
    assert found.angle < 1e-14
    assert np.array_equal(found.T, arm.pose(found.q))


def test_a_stretched_arm_for_a_pose_too_far_away():
    T = np.eye(4)
    T[0, 3] = 4.0  # the arm reaches 1.5, in any orientation in its plane
    found = nearest(PLANAR, T)
    assert found.distance == pytest.approx(2.5, abs=1e-14)
    assert found.angle < 1e-7
    assert found.T[0, 3] == pytest.approx(1.5, abs=1e-14)


def test_a_tilt_that_the_arm_lacks_is_all_that_remains():
    T = PLANAR.pose(np.array([0.3, 0.8, -0.5]))
    c, s = np.cos(0.3), np.sin(0.3)
    T[:3, :3] = np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ T[:3, :3]
    found = nearest(PLANAR, T)
    assert found.distance < 1e-12
    assert found.angle == pytest.approx(0.3, abs=1e-12)


def test_no_small_move_comes_nearer():
    rng = np.random.default_rng(6)
    for size in (3, 5, 6):
        arm = random_arm(rng, size)
        T = arm.pose(rng.uniform(-3, 3, size))
        T[:3, 3] = 1.3 * arm.length * np.array([0.6, -0.64, 0.48])
        found = nearest(arm, T)
        least = _cost(arm, T, found.q)
        assert found.distance > 0.1 * arm.length
        moved = found.q + 1e-4 * rng.standard_normal((200, size))
        assert all(_cost(arm, T, q) >= least for q in moved)
        far = rng.uniform(-np.pi, np.pi, (2000, size))
        assert all(_cost(arm, T, q) > least for q in far)


def _cost(arm, T, q):
    pose = arm.pose(q)
    R = T[:3, :3] @ pose[:3, :3].T
    angle = np.arccos(np.clip((np.trace(R) - 1) / 2, -1, 1))
    return np.sum((T[:3, 3] - pose[:3, 3]) ** 2) + (arm.length * angle) ** 2
