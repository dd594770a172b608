"""Poses next to one singular configuration and to two: three ways to solve them agree.

The target pose is rounded to 2e-16 and a configuration next to singular ones is known to this over
the smallest singular value: the one that a pose was made from is there to 1e-9, or as a solution
from which no forward model in doubles tells it, or as one of a self-motion.
"""

import numpy as np
import pytest
from support.arm_search import distance
from support.near_singular import KINDS, ROBOTS, near_singular, plain, robot, told_apart

from mbs.models.inverse_geometry import solve, solve_many, solver

ROUNDING = 3e-14
"""What a double root, listed in the middle of its two, may leave on the way to either."""

FEW = [(name, kind, 0) for name in ROBOTS[:-1] for kind in KINDS] + [(ROBOTS[-1], "wrist", 0)]
MORE = [(name, kind, k) for name, kind, _ in FEW for k in range(1, 10)]


def same_set(arm, q, other):
    return len(q) == len(other) and all(np.min(distance(arm, other, x)) < 1e-9 for x in q)


def contains(name, T, answer, q):
    if any(s.family is not None and s.family.contains(q) for s in answer):
        return True
    away = distance(plain(name), answer.q, q)
    nearest = int(np.argmin(away))
    return away[nearest] < 1e-9 or (
        away[nearest] < 0.1 and told_apart(name, T, q, answer.q[nearest]) < ROUNDING
    )


def check(name, kind, seed):
    system, arm, q = robot(name), plain(name), near_singular(name, kind, seed)
    T = arm.pose(q)
    answer = solve(system, T)
    assert contains(name, T, answer, q)
    assert np.max(arm.residual(T, answer.q)) < 1e-12 * max(1.0, arm.reach)
    assert same_set(arm, answer.q, solve_many(system, T[None]).of(0))
    assert same_set(arm, answer.q, solver(system)(T).q)


@pytest.mark.parametrize(("name", "kind", "seed"), FEW)
def test_next_to_singular_configurations(name, kind, seed):
    check(name, kind, seed)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "kind", "seed"), MORE)
def test_next_to_many_singular_configurations(name, kind, seed):
    check(name, kind, seed)


def test_the_other_side_of_the_shoulder_is_found():
    """The wrist centre 1e-10 from axis 1: the steps of the closed form meet, a search crawls."""
    q = near_singular("rx90", "shoulder", 1)
    T = plain("rx90").pose(q)
    answer = solve(robot("rx90"), T)
    assert len(answer) == 8
    assert [s.multiplicity for s in answer] == [1] * 8


@pytest.mark.parametrize(("name", "kind", "seed"), [FEW[0], ("rx90", "shoulder", 1)])
def test_without_a_compiler(name, kind, seed, no_compiler):
    robot.cache_clear()
    check(name, kind, seed)


def test_two_branches_of_a_closed_form_are_told_apart_from_a_ten_millionth_on():
    system, arm = robot("ur5"), plain("ur5")
    for away, count in ((1e-6, 2), (1e-9, 1)):
        q = np.array([0.3, -0.9, away, 0.7, 0.8, 0.2])
        near = [s for s in solve(system, arm.pose(q)) if distance(arm, s.q, q) < 1e-3]
        assert len(near) == count
        assert {s.multiplicity for s in near} == {3 - count}


def test_where_two_singular_configurations_meet_the_other_shoulder_is_found():
    """The closed form has one side only; no direction of the null space leads to the other."""
    q = near_singular("rx90", "elbow and shoulder", 3)
    found = solve(robot("rx90"), plain("rx90").pose(q))
    turned = np.mod(found.q[:, 0] - q[0] + 1, 2 * np.pi) - 1
    assert np.sum(np.abs(turned) < 1e-2) == np.sum(np.abs(turned - np.pi) < 1e-2) == 2


def test_a_branch_of_a_closed_form_is_one_root():
    """Terms that nearly vanish had it counted four times."""
    found = solve(robot("kr6"), plain("kr6").pose(near_singular("kr6", "elbow and shoulder", 8)))
    assert [s.multiplicity for s in found] == [1] * 8
    met = solve(
        robot("puma560"), plain("puma560").pose(near_singular("puma560", "elbow and shoulder", 1))
    )
    assert sum(s.multiplicity for s in met) == 8
