"""Limits and whole turns."""

import math
from functools import cache

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.errors import ModelError
from mbs.models.inverse_geometry import solve
from mbs.models.inverse_geometry.solutions import bounds

TURN = 2 * math.pi


@cache
def system():
    return catalogue_system("puma560")


Q = np.array([0.3, -0.5, 0.7, 0.4, 0.9, 0.2])


def pose():
    return np.array(mbs.models.direct_geometry(system())(Q))


def test_solutions_are_marked_or_left_out():
    marked = solve(system(), pose())
    within = [s for s in marked if s.within_limits]
    assert 0 < len(within) < len(marked) == 8
    low, high = np.array([c.limits for c in system().coordinates]).T
    for solution in marked:
        inside = np.all((solution.q >= low) & (solution.q <= high))
        assert solution.within_limits == inside
        assert (len(solution.windings) > 0) == inside
    kept = solve(system(), pose(), limits=True)
    assert kept.q == pytest.approx(np.array([s.q for s in within]))


def test_limits_by_name_replace_and_leave_out():
    every = solve(system(), pose()).q
    wide = {f"q{k + 1}": None for k in range(6)}
    assert len(solve(system(), pose(), limits=wide)) == 8
    kept = solve(system(), pose(), limits=wide | {"q1": (0.0, 1.0)})
    assert len(kept) == np.sum((every[:, 0] >= 0) & (every[:, 0] <= 1))


def test_a_range_away_from_zero_is_wound_into():
    """An angle of -2.19 is 4.09 in a joint that goes from 0 to a whole turn."""
    answer = solve(system(), pose(), limits={"q1": (0.0, TURN), "q4": None})
    assert np.all((answer.q[:, 0] >= 0) & (answer.q[:, 0] <= TURN))
    assert np.max(answer.q[:, 0]) > math.pi


def test_windings():
    answer = solve(system(), pose(), limits={"q6": (-3 * TURN, 3 * TURN), "q4": (-TURN, TURN)})
    for solution in answer:
        assert np.all(solution.windings[0] == solution.q)
        turns = (solution.windings - solution.q) / TURN
        assert np.max(np.abs(turns - np.round(turns))) < 1e-12
        assert len(solution.windings) == 12
        far = np.linalg.norm(solution.windings, axis=1)
        assert np.all(np.diff(far) > -1e-12)


def test_windings_are_bounded():
    found = bounds(system(), {f"q{k + 1}": (-1000, 1000) for k in range(6)})
    windings = found.windings(Q, np.zeros(6))
    assert windings.shape == (64, 6)
    assert np.all(windings[0] == Q)


def test_turns_are_towards_the_seed():
    found = bounds(system(), {f"q{k + 1}": None for k in range(6)})
    near = np.array([7.0, -7.0, 0.0, 20.0, 3.0, 0.0])
    wound = found.wrap_to_limits(Q, near)
    assert np.max(np.abs(wound - near)) <= math.pi
    assert np.max(np.abs(np.sin(wound - Q))) < 1e-12
    narrow = bounds(system(), {"q1": (-1.0, 1.0), "q2": None, "q4": None, "q5": None})
    assert narrow.wrap_to_limits(Q, near)[0] == Q[0]


def test_a_joint_outside_stays_near_the_seed():
    found = bounds(system(), {"q1": (1.0, 2.0)})
    assert found.outside(Q) == ["q1"]
    assert found.wrap_to_limits(Q, np.zeros(6))[0] == pytest.approx(Q[0])
    assert len(found.windings(Q, np.zeros(6))) == 0


def test_the_edge_belongs_to_the_range():
    assert bounds(system(), {"q1": (0.3, 0.5)}).outside(Q) == []
    assert bounds(system(), {"q1": (0.3 + 1e-6, 0.5)}).outside(Q) == ["q1"]


def test_slides_are_never_wound():
    scara = catalogue_system("scara")
    found = bounds(scara, {"q4": (-20, 20)})
    assert found.windings(np.array([0.1, 0.2, 0.3, -0.1]), np.full(4, 9.0))[:, 3] == -0.1


@pytest.mark.parametrize(
    ("limits", "said"),
    [
        ({"q9": (0, 1)}, "'q9', which is no coordinate"),
        ({"q1": (2, 1)}, r"the limits of q1 are \(2, 1\)"),
        ({"q1": 3}, "the limits of q1 are 3"),
        ({"q1": (0, float("nan"))}, r"give \(lowest, highest\)"),
        ("wide", "limits is 'wide'; give True"),
        ([1, 2], r"limits is \[1, 2\]"),
    ],
)
def test_wrong_limits_are_named(limits, said):
    with pytest.raises(ModelError, match=said):
        bounds(system(), limits)
