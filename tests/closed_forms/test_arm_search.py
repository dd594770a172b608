import numpy as np
import pytest
from support.plain_arms import apart, manseur_doty, puma, random_arm

from mbs.closed_forms.arm_search import (
    SEED,
    counted_search,
    random_configurations,
    search,
)


def test_all_configurations_of_an_arm_with_a_wrist():
    arm, q = puma(), np.array([0.4, -0.7, 0.5, 1.1, 0.8, -2.0])
    T = arm.pose(q)
    found = search(arm, T)
    assert found.shape == (8, 6)
    assert np.max(np.abs(arm.pose(found) - T)) < 1e-14
    assert np.min(apart(arm, found, q[None])) < 1e-12


def test_the_sixteen_configurations_of_manseur_and_doty():
    arm, T = manseur_doty()
    found, hits = counted_search(arm, T, starts=600)
    assert found.shape == (16, 6)
    assert np.min(hits) >= 5
    off_diagonal = apart(arm, found, found) + 10 * np.eye(16)
    assert np.min(off_diagonal) > 1e-2


def test_slides_far_longer_than_the_arm():
    rng = np.random.default_rng(5)
    arm = random_arm(rng, 6, [True, True, True, False, False, False])
    q = np.array([30.0, -20.0, 25.0, 0.3, -1.0, 2.0])
    found = search(arm, arm.pose(q))
    assert np.min(apart(arm, found, q[None])) < 1e-10


@pytest.mark.parametrize("size", [3, 4, 5])
def test_arms_of_fewer_joints(size):
    rng = np.random.default_rng(size)
    arm = random_arm(rng, size)
    q = rng.uniform(-3, 3, size)
    assert np.min(apart(arm, search(arm, arm.pose(q)), q[None])) < 1e-12
    other = arm.pose(rng.uniform(-3, 3, size))
    other[:3, 3] += 0.05 * arm.length
    assert search(arm, other).shape == (0, size)


def test_seven_joints_give_samples_that_all_solve():
    rng = np.random.default_rng(7)
    arm = random_arm(rng, 7)
    T = arm.pose(rng.uniform(-3, 3, 7))
    found = search(arm, T, starts=60)
    assert len(found) > 20
    assert np.max(np.abs(arm.pose(found) - T)) < 1e-12


def test_the_same_seed_gives_the_same_configurations():
    arm, T = manseur_doty()
    assert np.array_equal(search(arm, T, 50, seed=3), search(arm, T, 50, seed=3))
    assert not np.array_equal(search(arm, T, 50, seed=3), search(arm, T, 50, seed=4))


def test_random_configurations_fill_the_range():
    arm = random_arm(np.random.default_rng(1), 2, [False, True])
    T = arm.pose(np.array([0.2, 0.3]))
    q = random_configurations(arm, T, 4000, SEED)
    reach = arm.length + np.linalg.norm(T[:3, 3])
    for values, span in ((q[:, 0], np.pi), (q[:, 1], reach)):
        assert np.max(np.abs(values)) <= span
        counts = np.histogram(values, bins=10, range=(-span, span))[0]
        assert np.all(np.abs(counts - 400) < 5 * np.sqrt(400))
