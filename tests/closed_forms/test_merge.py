import numpy as np
import pytest
from support.plain_arms import khalil, puma

from mbs.closed_forms.arm_search import merged, wrapped

PLANAR = khalil([(0, 0, 0, 0), (0, 1.0, 0, 0), (0, 0.7, 0, 0)])


def test_copies_and_whole_turns_are_one_and_the_best_stays():
    arm, q = puma(), np.array([0.1, -0.4, 0.7, 0.2, 0.9, 3.1])
    given = np.array([q + 1e-8, q, q + 2 * np.pi, q + 0.5])
    found, hits = merged(arm, arm.pose(q), given)
    assert np.array_equal(found, given[[1, 3]])
    assert hits.tolist() == [3, 1]


def test_copies_of_a_double_root_are_one():
    q = np.array([0.3, 0.0, 0.0])
    away = 1e-7 * np.array([0.7 / 1.7, -1.0, 1.0 / 1.7]) * 5
    _, hits = merged(PLANAR, PLANAR.pose(q), np.array([q + away, q - away]))
    assert hits.tolist() == [2]


def test_close_solutions_with_none_between_are_two():
    bend = 1e-3
    a = np.array([0.3, bend, 0.2])
    T = PLANAR.pose(a)
    shoulder = 2 * np.arctan2(0.7 * np.sin(bend), 1 + 0.7 * np.cos(bend))
    b = np.array([a[0] + shoulder, -bend, a[2] + 2 * bend - shoulder])
    assert np.max(np.abs(PLANAR.pose(b) - T)) < 1e-15
    assert len(merged(PLANAR, T, np.array([a, b]))[0]) == 2


def test_none_are_none():
    assert merged(PLANAR, np.eye(4), np.zeros((0, 3)))[0].shape == (0, 3)


def test_angles_are_wrapped_into_one_turn_and_slides_are_not():
    arm = khalil([(0, 0, 0, 0), (0, 1.0, 0, 0)], [False, True])
    q = np.array([[np.pi, 7.0], [-np.pi, -7.0], [4.0, 0.0], [-1.5, 0.0]])
    expected = np.array([[np.pi, 7.0], [np.pi, -7.0], [4.0 - 2 * np.pi, 0.0], [-1.5, 0.0]])
    assert wrapped(arm, q) == pytest.approx(expected, abs=1e-15)
