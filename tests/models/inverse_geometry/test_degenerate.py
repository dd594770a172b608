"""Poses next to and at singularities, and out of reach."""

from functools import cache

import numpy as np
import pytest
from support.arm_completeness import assert_complete, assert_exact, assert_same_set
from support.arm_poses import folded, least_gap, over_shoulder, stretched, with_wrist
from support.arm_search import distance, merged, plain_arm, searched, some, wrapped
from support.catalogue_systems import catalogue_system

from mbs.models.inverse_geometry import solve

WRISTS = ("puma560", "rx90", "tx90", "kr6", "irb120")
HALF_TURN = np.array([0, 0, 0, np.pi, 0, np.pi])


@cache
def assembled(name):
    return catalogue_system(name)


def configuration(name, seed=0):
    return np.random.default_rng((11, seed, *name.encode())).uniform(-2.5, 2.5, 6)


def flipped(q):
    """The same pose by the other root of the wrist."""
    return (q + HALF_TURN) * [1, 1, 1, 1, -1, 1]


@cache
def regular_count(name):
    """How many configurations the wrist centre has, times two."""
    arm = plain_arm(assembled(name))
    return len(searched(arm, arm.pose(configuration(name))))


@pytest.mark.sweep
@pytest.mark.parametrize("q5", [1e-5, 1e-7])
@pytest.mark.parametrize("name", WRISTS)
def test_near_the_wrist_singularity(name, q5):
    """As many configurations as with the same wrist centre elsewhere, the two close ones among
    them."""
    system = assembled(name)
    arm, q = plain_arm(system), with_wrist(configuration(name), q5)
    T = arm.pose(q)
    answer = solve(system, T)
    assert_exact(arm, T, answer.q)
    assert all(s.family is None for s in answer)
    assert len(answer) == regular_count(name)
    for near in (q, flipped(q)):
        assert np.min(distance(arm, answer.q, near)) < 1e-8 / abs(q5)  # rounding over sigma_min


@pytest.mark.parametrize("name", WRISTS)
def test_at_the_wrist_singularity(name):
    """q4 and q6 turn together; the other configurations of the wrist centre are regular.

    An RX90 lies in a plane with axis 1: turned by half a turn it has the same forearm.
    """
    system = assembled(name)
    arm, q = plain_arm(system), with_wrist(configuration(name), 0.0)
    T = arm.pose(q)
    answer = solve(system, T)
    assert_exact(arm, T, answer.q)
    families = [s.family for s in answer if s.family is not None]
    assert len(families) == (2 if name == "rx90" else 1)
    expected = np.concatenate([some(arm, T, np.random.default_rng(k)) for k in range(2)])
    alone = arm.smallest(expected) > 1e-5
    regular = answer.q[[s.family is None for s in answer]]
    assert_same_set(arm, regular, merged(arm, T, expected[alone]))
    assert not np.all(alone)
    for other in [q, *expected[~alone][:10]]:
        assert any(family.contains(other) for family in families)
    for family in families:
        assert set(family.moving) == {"q4", "q6"}
        assert family.range is None
        assert not family.contains(q + 1e-3)
        for angle in (-2.0, 0.3, 2.9):
            assert arm.residual(T, family.at(angle)) < 1e-12


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", ["puma560", "rx90", "irb120"])
def test_stretched_elbow_is_a_double_root(name, seed):
    """Both shoulders reach it with a stretched arm only: two times two wrists, all double."""
    system, count = assembled(name), 4
    arm, q = plain_arm(system), stretched(system, configuration(name, seed))
    T = arm.pose(q)
    answer = solve(system, T)
    assert_exact(arm, T, answer.q)
    assert len(answer) == count
    assert [s.multiplicity for s in answer] == [2] * count
    assert all(s.sigma_min < 1e-6 for s in answer)
    assert np.min(distance(arm, answer.q, q)) < 1e-6


@pytest.mark.parametrize("name", ["tx90", "kr6"])
def test_stretched_elbow_of_one_shoulder_is_a_double_root(name):
    """With axis 2 off axis 1 the other shoulder is nearer or out of reach, never stretched."""
    system = assembled(name)
    arm, q = plain_arm(system), stretched(assembled(name), configuration(name))
    T = arm.pose(q)
    answer = solve(system, T)
    assert_exact(arm, T, answer.q)
    double = np.array([s.multiplicity == 2 for s in answer])
    assert_same_set(arm, answer.q[double], wrapped(arm, np.array([q, flipped(q)])))
    assert all(s.multiplicity == 1 for s, two in zip(answer, double, strict=True) if not two)


@pytest.mark.parametrize("name", ["rx90", "kr6"])
def test_wrist_over_the_shoulder(name):
    """The wrist centre on axis 1: the arm turns about it, the wrist makes up for it."""
    system = assembled(name)
    arm, q = plain_arm(system), over_shoulder(assembled(name), configuration(name, 1))
    T = arm.pose(q)
    answer = solve(system, T)
    assert_exact(arm, T, answer.q)
    families = [s.family for s in answer]
    assert families
    assert all(family is not None and "q1" in family.moving for family in families)
    sample = some(arm, T, np.random.default_rng(0))
    assert len(sample) > 30
    for other in [q, *sample[:12]]:
        assert any(family.contains(other) for family in families)


@pytest.mark.parametrize("seed", range(3))
def test_folded_next_to_two_singularities(seed):
    """The wrist centre 2 mm from axis 2 and the arm folded: a search crawls, counts are known."""
    system = assembled("puma560")
    assert least_gap(system) < 2e-3
    arm, q = plain_arm(system), folded(system, configuration("puma560", seed), 2e-3)
    T = arm.pose(q)
    answer = solve(system, T)
    assert_exact(arm, T, answer.q)
    assert len(answer) == 8
    assert all(s.multiplicity == 1 for s in answer)
    assert np.min(distance(arm, answer.q, q)) < 1e-6
    assert np.min(distance(arm, answer.q, flipped(q))) < 1e-6


@pytest.mark.parametrize("name", ["puma560", "tx90", "ur5", "crx10"])
def test_out_of_reach(name):
    system = assembled(name)
    arm = plain_arm(system)
    T = arm.pose(configuration(name))
    T[:3, 3] += 3 * arm.reach * T[:3, 0]
    answer = solve(system, T)
    assert len(answer) == 0
    assert answer.q.shape == (0, 6)
    assert "reach" in answer.reason
    assert answer.nearest is not None
    near = arm.pose(answer.nearest.q)
    gap = np.linalg.norm(near[:3, 3] - T[:3, 3])
    assert arm.reach < gap < 5 * arm.reach


@pytest.mark.parametrize("name", ["scara", "youbot"])
def test_pose_that_fewer_than_six_joints_cannot_take(name):
    system = assembled(name)
    arm = plain_arm(system)
    q = arm.random(np.random.default_rng(5))
    T = arm.pose(q)
    tilt = np.array([[1, 0, 0], [0, np.cos(0.2), -np.sin(0.2)], [0, np.sin(0.2), np.cos(0.2)]])
    off = T.copy()
    off[:3, :3] = tilt @ T[:3, :3]
    answer = solve(system, off)
    assert len(answer) == 0
    assert answer.reason
    assert "reach" not in answer.reason or "manifold" in answer.reason
    assert_complete(system, q)
