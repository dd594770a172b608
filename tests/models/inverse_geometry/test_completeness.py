"""Every configuration of catalogue robots at generic poses: `solve` against a multi-start
search."""

from functools import cache
from math import radians

import numpy as np
import pytest
from support.arm_completeness import assert_complete, assert_exact, assert_same_set
from support.arm_search import merged, plain_arm
from support.catalogue_systems import catalogue_system

from mbs.models.inverse_geometry import solve

ROBOTS = (
    "puma560",
    "rx90",
    "tx90",
    "kr6",
    "irb120",
    "ur5",
    "crx10",
    "stanford",
    "manseur_doty",
    "gantry",
    "scara",
    "youbot",
)
# Manocha & Canny 1994, table III, two of the sixteen configurations, printed to 0.01 degree.
PRINTED = [
    [2.51, 108.07, 112.04, -10.52, 0.0, -0.10],
    [-96.28, -6.27, -0.03, 141.51, 127.44, 140.59],
]


@cache
def assembled(name):
    return catalogue_system(name)


def configuration(arm, name, seed):
    return arm.random(np.random.default_rng((7, seed, *name.encode())))


@pytest.mark.sweep
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", ROBOTS)
def test_robot(name, seed):
    system = assembled(name)
    assert_complete(system, configuration(plain_arm(system), name, seed))


@pytest.mark.sweep
@pytest.mark.parametrize("joint", range(7))
def test_panda_with_one_joint_locked(joint):
    system = assembled("panda")
    rng = np.random.default_rng((8, joint))
    locked = {f"q{joint + 1}": float(rng.uniform(-1, 1))}
    assert_complete(system, plain_arm(system, locked).random(rng), locked)


@pytest.mark.parametrize("start", range(2))
def test_manseur_doty_has_sixteen(start):
    """The pose of a printed configuration is the published one to the digits printed."""
    system = assembled("manseur_doty")
    arm = plain_arm(system)
    T = arm.pose([radians(angle) for angle in PRINTED[start]])
    answer = solve(system, T)
    assert len(answer) == 16
    assert_exact(arm, T, answer.q)


def test_crx_has_up_to_sixteen():
    """Among random poses some have more than the eight configurations of a spherical wrist."""
    system = assembled("crx10")
    arm = plain_arm(system)
    counts = []
    for q in arm.random(np.random.default_rng(3), 12):
        T = arm.pose(q)
        found = solve(system, T).q
        assert_exact(arm, T, found)
        assert_same_set(arm, merged(arm, T, np.vstack([found, q])), found)
        counts.append(len(found))
    assert max(counts) > 8
