"""Why an answer is empty."""

from functools import cache

import numpy as np
import pytest
from support.arms import general_5r
from support.catalogue_systems import catalogue_system

import mbs
from mbs.models.inverse_geometry import solve


@cache
def assembled(name):
    return catalogue_system(name)


def pose(system, q):
    return np.array(mbs.models.direct_geometry(system)(q))


def test_out_of_reach_says_how_far():
    system = assembled("planar_2r")
    q = [0.3, 0.8]
    T = pose(system, q)
    T[2, 3] = 0.25
    answer = solve(system, T)
    assert len(answer) == 0
    assert answer.q.shape == (0, 2)
    assert answer.reason.startswith("out of reach: the position is too far or too near")
    assert answer.nearest.distance == pytest.approx(0.25, abs=1e-9)
    assert answer.nearest.angle == pytest.approx(0.0, abs=1e-9)
    assert answer.reason.endswith("the nearest reachable pose is 0.25 m away")
    assert pose(system, answer.nearest.q) == pytest.approx(answer.nearest.T, abs=1e-12)


def test_a_six_joint_arm_out_of_reach():
    system = assembled("puma560")
    T = pose(system, [0.3, -0.5, 0.7, 0.4, 0.9, 0.2])
    T[:3, 3] = [3.0, 0.2, 0.1]
    answer = solve(system, T)
    assert len(answer) == 0
    assert answer.reason.startswith("out of reach")
    assert answer.nearest.distance > 2.0
    assert answer.nearest.q.shape == (6,)


def test_off_the_manifold_of_five_joints():
    system = general_5r(1)
    q = np.array([0.3, -0.5, 0.7, 0.4, 0.9])
    T = pose(system, q)
    assert len(solve(system, T)) > 0
    turn = np.array([[np.cos(0.1), -np.sin(0.1), 0], [np.sin(0.1), np.cos(0.1), 0], [0, 0, 1]])
    T[:3, :3] = turn @ T[:3, :3]
    answer = solve(system, T)
    assert len(answer) == 0
    assert answer.reason.startswith("the pose is off the manifold that 5 joints can reach")
    assert "its position alone is reached, and so is the orientation alone" in answer.reason
    assert answer.nearest.angle < 0.1 + 1e-9


def test_limits_say_which_joint_excludes_most():
    system = assembled("puma560")
    T = pose(system, [0.3, -0.5, 0.7, 0.4, 0.9, 0.2])
    answer = solve(system, T, limits={"q1": (1.0, 1.1), "q4": None, "q2": None})
    assert len(answer) == 0
    assert answer.reason.startswith("limits: all 8 solutions are outside; q1 in 8 of 8")
    assert answer.nearest is None


def test_one_solution_outside():
    system = assembled("planar_2r")
    answer = solve(system, pose(system, [0.3, 0.8]), limits={"q2": (-1, 0)})
    assert answer.reason == "limits: the only solution is outside; q2 in 1 of 1"
    with pytest.raises(mbs.errors.ModelError, match="there is no solution; limits"):
        answer.closest([0.0, 0.0])
