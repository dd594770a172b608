"""Distances from singular configurations at which a list changes: they show the thresholds.

The distance grows in half decades, so that a threshold that is ten times as large or as small
moves a change of the list by two poses.
"""

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.models.inverse_geometry import solve, solve_many
from mbs.models.inverse_geometry.chain import frame_chain
from mbs.models.inverse_geometry.draft import pose_draft
from mbs.models.inverse_geometry.target import Target, distinct

NONE = np.zeros(0)
Q = np.array([0.3, -0.7, 0.9, 0.4, 0.8, -1.1])
ELBOW, WRIST = 2, 4


def at(q, joint, value):
    q = q.copy()
    q[joint] = value
    return q


def near(system, joint, decades):
    """Poses (N, 4, 4) with a joint of the UR5 at 10^-decade from its singular position zero."""
    transform = mbs.models.transform(system, 6)
    return np.array([np.array(transform(at(Q, joint, 10.0**-decade))) for decade in decades])


def first(decades, flags):
    """The first decade at which a flag is set."""
    return float(decades[np.argmax(flags)])


@pytest.fixture(scope="module")
def ur5():
    return catalogue_system("ur5")


def test_an_elbow_that_gets_straight(ur5):
    decades = np.arange(3, 9.1, 0.5)
    T = near(ur5, ELBOW, decades)
    found = solve_many(ur5, T)
    assert first(decades, found.searched) == 5.0
    assert decades[found.undecided].tolist() == [6.0]
    assert first(decades, found.count < 6) == 6.5
    double = [max(s.multiplicity for s in solve(ur5, pose)) for pose in T[6:8]]
    assert double == [1, 2]


def test_a_wrist_that_gets_straight(ur5):
    decades = np.arange(4, 15.1, 0.5)
    found = solve_many(ur5, near(ur5, WRIST, decades))
    assert first(decades, found.searched) == 5.5
    assert first(decades, found.undecided) == 11.5
    assert first(decades, found.count < 8) == 13.0
    assert decades[found.undecided].tolist() == [11.5, 12.0, 12.5, 13.0]


def test_a_step_of_a_closed_form_that_loses_digits():
    """Regularity of the wrist is the square of the sine of joint 5: 10^-5 is between both."""
    chain = frame_chain(catalogue_system("puma560"))
    arm = chain.arm(NONE)
    drafts = [
        pose_draft(chain, Target(arm, arm.pose(at(Q, WRIST, 10.0**-decade))), "pieper", NONE)
        for decade in (2.25, 2.75)
    ]
    assert [draft.certain for draft in drafts] == [True, False]


def test_the_general_method_near_a_singular_configuration():
    system = catalogue_system("manseur_doty")
    arm = frame_chain(system).arm(NONE)

    def determinant(x):
        return np.linalg.det(arm.pose_and_jacobian(at(Q, WRIST, x))[1])

    x = np.linspace(-3, 3, 61)
    values = [determinant(own) for own in x]
    k = next(k for k in range(60) if values[k] * values[k + 1] < 0)
    low, high = x[k], x[k + 1]
    for _ in range(60):
        middle = (low + high) / 2
        same = determinant(middle) * determinant(low) > 0
        low, high = (middle, high) if same else (low, middle)

    def least(offset):
        q = at(Q, WRIST, low + offset)
        return float(Target(arm, arm.pose(q)).singular_values(q)[-1])

    slope = least(1e-3) / 1e-3
    T = arm.pose(np.array([at(Q, WRIST, low + value / slope) for value in (3e-4, 3e-5)]))
    assert solve_many(system, T).searched.tolist() == [False, True]


def test_copies_on_a_self_motion_are_one_as_far_as_a_hundredth_of_a_radian():
    arm = frame_chain(catalogue_system("puma560")).arm(NONE)
    q, along = at(Q, WRIST, 0.0), np.array([0, 0, 0, 1.0, 0, -1.0])
    target = Target(arm, arm.pose(q))
    counts = [len(distinct(target, np.array([q, q + way * along]))) for way in (3e-3, 3e-2)]
    assert counts == [1, 2]
