"""All configurations of a pose, with and without loops, and poses as people write them."""

import math
import pickle

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs import MbsError
from mbs.app.tasks.configurations import (
    configurations,
    locked_by_default,
    pose_from,
    pose_from_text,
    pose_of,
    rpy_of,
)
from mbs.errors import ModelError, NoClosedForm

START = (0.3, -0.5, 0.7, 0.4, -0.9, 0.2)


@pytest.fixture(scope="module")
def rx90():
    return catalogue_system("rx90")


@pytest.fixture(scope="module")
def five_bar():
    return catalogue_system("five_bar")


def _is_in(found, q):
    away = np.array([row.q for row in found.rows]) - np.array(q)
    return bool(np.any(np.abs(np.sin(away / 2)).max(axis=1) < 1e-9))


@pytest.mark.parametrize("method", ["auto", "pieper", "paul", "general", "search"])
def test_every_method_finds_eight_configurations_of_the_rx90(rx90, method):
    T = pose_of(rx90, START)
    found = configurations(rx90, T, method=method, seed=START)
    assert len(found.rows) == 8
    assert np.allclose(found.rows[0].q, START, atol=1e-9)
    assert len({row.label for row in found.rows}) == 8
    for row in found.rows:
        assert np.allclose(pose_of(rx90, row.q), T, atol=1e-12)
        assert row.residual < 1e-12
        assert (row.multiplicity, row.family) == (1, "")
    assert (found.reason, found.nearest) == ("", None)
    assert pickle.loads(pickle.dumps(found)) == found


def test_configurations_of_robots_with_loops_close_them(five_bar):
    sr400 = catalogue_system("sr400")
    q = mbs.loops.solve(sr400, {"q2": -1.2, "q4": 0.3, "q5": 0.8, "q6": -0.4})
    found = configurations(sr400, pose_of(sr400, q), seed=q)
    assert np.allclose(found.rows[0].q, q, atol=1e-9)
    assert len(found.rows) >= 8
    assert all(mbs.loops.configuration_report(sr400, row.q).residual < 1e-10 for row in found.rows)
    T = pose_of(five_bar, five_bar.configuration)
    found = configurations(five_bar, T)
    assert len(found.rows) == 2
    assert _is_in(found, five_bar.configuration)


def test_legs_and_short_chains():
    delta = catalogue_system("delta")
    found = configurations(delta, pose_of(delta, None), method="pieper")
    assert (len(found.rows), found.method) == (8, "loops in closed form")
    tree = catalogue_system("two_branch_tree")
    q = [0.2, 0.1, -0.3, 0.05, 0.6, -0.7, 0.4]
    found = configurations(tree, pose_of(tree, q), method="general", seed=q)
    assert found.method == "search"
    assert np.allclose(found.rows[0].q, q, atol=1e-9)
    with pytest.raises(NoClosedForm, match="Pieper's method takes six"):
        configurations(tree, pose_of(tree, q), method="pieper")


def test_seven_joints_keep_one_where_it_is():
    panda = catalogue_system("panda")
    q = [0.1, 0.3, -0.2, -1.5, 0.2, 1.4, 0.3]
    assert locked_by_default(panda, seed=q) == {"q3": -0.2}
    found = configurations(panda, pose_of(panda, q), seed=q)
    assert found.locked == (("q3", -0.2),)
    assert np.allclose(found.rows[0].q, q, atol=1e-8)


def test_seven_joints_take_many_positions_of_one():
    panda = catalogue_system("panda")
    q = [0.1, 0.3, -0.2, -1.5, 0.2, 1.4, 0.3]
    found = configurations(panda, pose_of(panda, q), seed=q, redundant={"q7": 3})
    assert found.locked == ()
    assert found.redundant == (("q7", 3),)
    assert {row.q[6] for row in found.rows} <= {-2.8973, 0.0, 2.8973}
    assert len(found.rows) > 0
    assert max(row.residual for row in found.rows) < 1e-12
    fixed = configurations(panda, pose_of(panda, q), seed=q, locked={"q3": -0.2})
    assert fixed.redundant == ()


def test_limits_are_told_joint_by_joint():
    puma = catalogue_system("puma560")
    found = configurations(puma, pose_of(puma, [0.3, 0.2, 0.4, 0.1, 0.5, 0.2]))
    for row in found.rows:
        assert row.within_limits == (not row.outside)
        for name in row.outside:
            low, high = puma.coordinates[found.names.index(name)].limits
            value = row.q[found.names.index(name)]
            turns = value + 2 * math.pi * np.arange(-2, 3)
            assert not np.any((turns >= low) & (turns <= high))


def test_out_of_reach_tells_why_and_offers_the_nearest(rx90, five_bar):
    T = pose_of(rx90, START)
    T[0, 3] += 5.0
    found = configurations(rx90, T)
    assert found.rows == ()
    assert "out of reach" in found.reason
    near = pose_of(rx90, found.nearest.q)
    assert np.allclose(near, found.nearest.T, atol=1e-9)
    assert math.isclose(np.linalg.norm(near[:3, 3] - T[:3, 3]), found.nearest.distance)
    T = pose_of(five_bar, None)
    T[1, 3] += 5.0
    found = configurations(five_bar, T)
    assert found.rows == ()
    assert mbs.loops.configuration_report(five_bar, found.nearest.q).residual < 1e-10
    assert 4.0 < found.nearest.distance < 5.1


def test_place_and_angles(rx90):
    T = pose_of(rx90, START)
    assert np.allclose(pose_from(T[:3, 3], rpy_of(T)), T, atol=1e-14)
    quarter = pose_from((1, "1/2", 0), ("pi/2", 0, "-pi/2"))
    assert np.allclose(quarter[:3, :3], [[0, 0, -1], [-1, 0, 0], [0, 1, 0]], atol=1e-15)
    assert quarter[:3, 3].tolist() == [1, 0.5, 0]
    upright = pose_from((0, 0, 0), (0.4, math.pi / 2, 0.9))
    assert np.allclose(pose_from((0, 0, 0), rpy_of(upright)), upright, atol=1e-12)


def test_poses_from_text():
    T = pose_from((0.1, -2, 3), (0.1, 0.2, 0.3))
    rows = "\n".join(" ".join(map(repr, row)) for row in T.tolist())
    assert pose_from_text(rows).tolist() == T.tolist()
    assert pose_from_text("; ".join(rows.splitlines()[:3])).tolist() == T.tolist()
    assert pose_from_text("0.1 -2, 3 0.1 0.2 0.3").tolist() == T.tolist()
    assert np.allclose(pose_from_text("0 0 0 0 pi/2 0")[:3, 0], [0, 0, -1], atol=1e-15)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("1 2 3", "has 3 numbers; write x y z roll pitch yaw"),
        ("1 2 3 0 0 L2", "pose: 'L2' is not a number"),
        ("1 2 3 0 0 system(1)", "'system' is not a function here"),
        ("1/0 2 3 0 0 0", "pose: '1/0' is not a finite number"),
        ("1 " * 3000, "6000 characters"),
    ],
)
def test_wrong_poses_are_refused(text, sentence):
    with pytest.raises(MbsError, match=sentence):
        pose_from_text(text)


def test_what_is_no_pose_or_no_name_is_refused(rx90):
    T = pose_of(rx90, START)
    with pytest.raises(ModelError, match="there is no frame 'tip'"):
        configurations(rx90, T, "tip")
    with pytest.raises(ModelError, match="has length 2"):
        configurations(rx90, T @ np.diag([2.0, 1, 1, 1]))
    with pytest.raises(ModelError, match="three coordinates and three angles"):
        pose_from((1, 2), (0, 0, 0))
