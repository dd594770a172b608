"""What the inverse geometric model must answer: all configurations of the search, and no other."""

from __future__ import annotations

import numpy as np
from support.arm_search import distance, plain_arm, searched

from mbs.models.inverse_geometry import solve

EXACT = 1e-12
SAME = 1e-5


def free_places(system, locked):
    """The places in q of the joints that are solved for."""
    names = [row.name for row in system.coordinates]
    return [k for k, name in enumerate(names) if name not in (locked or {})]


def assert_exact(arm, T, q):
    """No configuration is wrong, none is there twice."""
    scale = max(1.0, arm.reach)
    assert np.all(np.isfinite(q))
    assert np.all(arm.residual(T, q) < EXACT * scale)
    for k in range(len(q)):
        assert np.all(distance(arm, q[k + 1 :], q[k]) > SAME)


def assert_same_set(arm, found, expected):
    """As many, and to each expected configuration one within SAME."""
    assert len(found) == len(expected)
    for q in expected:
        assert np.min(distance(arm, found, q)) < SAME


def assert_complete(system, configuration, locked=None, seed=0):
    """`solve` answers what the search finds at the pose of a configuration (free joints alone)."""
    arm, places = plain_arm(system, locked), free_places(system, locked)
    T = arm.pose(configuration)
    answer = solve(system, T, locked=locked) if locked else solve(system, T)
    found = answer.q[:, places]
    assert_exact(arm, T, found)
    assert all(s.multiplicity == 1 and s.family is None for s in answer)
    expected = searched(arm, T, seed)
    assert np.min(distance(arm, expected, configuration)) < SAME  # else the search is not enough
    assert_same_set(arm, found, expected)
    return answer
