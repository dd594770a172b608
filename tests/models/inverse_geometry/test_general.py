import numpy as np
import pytest
from support.plain_arms import (
    apart,
    khalil,
    manseur_doty,
    puma,
    random_arm,
)

from mbs.closed_forms.arm_search import (
    general,
    general_many,
    general_of,
    search,
)
from mbs.errors import ModelError, NoClosedForm


def test_the_sixteen_configurations_of_manseur_and_doty():
    arm, T = manseur_doty()
    number, q = general_many(general_of(arm), T[None])
    assert number.tolist() == [0] * 16
    assert np.max(np.abs(arm.pose(q) - T)) < 1e-14
    assert np.min(apart(arm, q, q) + 10 * np.eye(16)) > 1e-2
    assert np.max(np.min(apart(arm, q, search(arm, T, 600)), axis=1)) < 1e-9


def test_random_arms_at_poses_they_reach():
    rng = np.random.default_rng(1)
    for _ in range(4):
        arm = random_arm(rng, 6)
        given = rng.uniform(-3, 3, (5, 6))
        T = arm.pose(given)
        number, q = general_many(general_of(arm), T)
        assert np.max(np.abs(arm.pose(q) - T[number])) < 1e-13
        for k in range(5):
            assert np.min(apart(arm, q[number == k], given[[k]])) < 1e-8
            assert np.sum(number == k) == len(search(arm, T[k], 400))


@pytest.mark.parametrize("slides", ["010000", "000100", "110000", "010100", "000111", "011100"])
def test_arms_with_slides(slides):
    rng = np.random.default_rng(int(slides, 2))
    arm = random_arm(rng, 6, [letter == "1" for letter in slides])
    given = rng.uniform(-1, 1, (6, 6))
    T = arm.pose(given)
    number, q = general_many(general_of(arm), T)
    assert np.max(np.abs(arm.pose(q) - T[number])) < 1e-12
    for k in range(6):
        assert np.min(apart(arm, q[number == k], given[[k]])) < 1e-7


def test_solutions_that_share_a_joint_and_those_that_nearly_meet():
    arm, rng = puma(), np.random.default_rng(3)
    given = rng.uniform(-3, 3, (9, 6))
    given[3:6, 4] = 1e-3
    given[6:, 4] = 1e-5
    number, _ = general_many(general_of(arm), arm.pose(given))
    assert np.bincount(number).tolist() == [8] * 9


def test_solutions_that_meet_count_once():
    arm = puma()
    given = np.array([0.4, -0.7, 0.0, 1.1, 0.8, -2.0])
    given[2] = _stretched(arm, given)
    number, q = general_many(general_of(arm), arm.pose(given)[None])
    assert len(number) == 4
    assert np.min(apart(arm, q, given[None])) < 1e-6


def test_a_pose_out_of_reach_has_no_configuration():
    for arm in (puma(), manseur_doty()[0]):
        T = arm.pose(np.full(6, 0.3))
        T[:3, 3] += 1.5 * arm.length * np.array([0.6, 0.0, 0.8])
        number, q = general_many(general_of(arm), T[None])
        assert number.shape == (0,)
        assert q.shape == (0, 6)


def test_one_pose_and_many():
    arm, T = manseur_doty()
    prepared = general_of(arm)
    number, q = general_many(prepared, np.repeat(T[None], 60, axis=0))
    assert np.array_equal(number, np.repeat(np.arange(60), 16))
    assert np.array_equal(q, np.tile(general(prepared, T), (60, 1)))
    assert general_many(prepared, np.zeros((0, 4, 4)))[1].shape == (0, 6)


def test_arms_that_the_method_does_not_hold_for():
    with pytest.raises(ModelError, match="six joints"):
        general_of(random_arm(np.random.default_rng(0), 5))
    planar = khalil([(0, 0, 0, 0), *[(0, 1.0, 0, 0)] * 5])
    with pytest.raises(NoClosedForm, match="singular at every configuration"):
        general_of(planar)


def _stretched(arm, q):
    """A position of joint 3 where the Jacobian is singular."""
    values = np.linspace(-3, 3, 50)
    found = [_determinant(arm, q, value) for value in values]
    k = np.flatnonzero(np.diff(np.sign(found)))[0]
    low, high = values[k], values[k + 1]
    for _ in range(60):
        middle = 0.5 * (low + high)
        if np.sign(_determinant(arm, q, middle)) == np.sign(found[k]):
            low = middle
        else:
            high = middle
    return low


def _determinant(arm, q, third):
    moved = np.array([*q[:2], third, *q[3:]])
    return np.linalg.det(arm.pose_and_jacobian(moved)[1])
