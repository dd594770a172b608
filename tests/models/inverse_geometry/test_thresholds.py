"""Distances from singular configurations at which a list changes: they show each threshold.

The distance from a singular configuration grows in half decades, so that a threshold that is ten
times as large or as small moves a change of the list by two poses.
"""

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.models.inverse_geometry import solve, solve_many

Q = np.array([0.3, -0.7, 0.9, 0.4, 0.8, -1.1])
ELBOW, WRIST = 2, 4


def near(system, joint, decades):
    """Poses (N, 4, 4) with a joint of the UR5 at 10^-decade from its singular position zero."""
    transform = mbs.models.transform(system, 6)
    poses = []
    for decade in decades:
        q = Q.copy()
        q[joint] = 10.0**-decade
        poses.append(np.array(transform(q)))
    return np.array(poses)


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
