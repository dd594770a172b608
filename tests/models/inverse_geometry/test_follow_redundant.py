"""Paths followed with more joints than a pose determines."""

import numpy as np
import pytest
from support.arms import human_like_arm
from support.catalogue_systems import catalogue_system

import mbs
from mbs.errors import ModelError
from mbs.models.inverse_geometry.chain import frame_chain

follow = mbs.models.inverse_geometry.follow
START = np.array([0.1, -0.4, 0.2, -1.9, 0.3, 1.6, 0.5])


@pytest.fixture(scope="module")
def panda():
    return catalogue_system("panda")


@pytest.fixture(scope="module")
def arm(panda):
    return frame_chain(panda, most=7).arm(np.zeros(0))


@pytest.fixture(scope="module")
def circle(arm):
    first = arm.pose(START)

    def pose(s):
        T = first.copy()
        angle = 2 * np.pi * s
        T[:3, 3] += 0.15 * np.array([np.cos(angle) - 1, np.sin(angle), 0.5 * np.sin(angle)])
        return T

    return pose


def manipulability(arm, q):
    J = arm.pose_and_jacobian(q)[1]
    return np.sqrt(np.linalg.det(J @ np.swapaxes(J, -1, -2)))


def off_middle(system, q):
    low, high = (np.array([c.limits[k] for c in system.coordinates]) for k in (0, 1))
    return np.sum(((q - (low + high) / 2) / ((high - low) / 2)) ** 2, axis=-1)


@pytest.mark.parametrize("criterion", [None, "limits", "manipulability"])
def test_the_path_is_kept(panda, arm, circle, criterion):
    found = follow(panda, circle, START, redundancy=criterion)
    assert found.reason == ""
    T = np.array([circle(s) for s in np.linspace(0, 1, 101)])
    assert arm.residual(found.q, T).max() < 1e-12
    assert found.residual.max() < 1e-12
    assert np.max(np.abs(np.diff(found.q, axis=0))) < 0.05
    J = arm.pose_and_jacobian(found.q)[1]
    J[:, :3] /= arm.length
    np.testing.assert_allclose(found.singular_values, np.linalg.svd(J)[1][:, 5], rtol=1e-9)


def test_minimum_velocity_moves_nothing_that_the_frame_does_not_see(panda, arm, circle):
    """Between poses the motion is along J+ to the third order of the step."""
    found = follow(panda, circle, START, samples=401, redundancy="minimum velocity")
    steps = np.diff(found.q, axis=0)
    J = arm.pose_and_jacobian((found.q[1:] + found.q[:-1]) / 2)[1]
    J[:, :3] /= arm.length
    still = np.linalg.svd(J)[2][:, 6]
    along = np.abs(np.sum(still * steps, axis=1))
    assert np.max(along / np.linalg.norm(steps, axis=1)) < 0.01
    free = follow(panda, circle, START, samples=401, redundancy=lambda q: q - 2 * START)
    shorter = np.sum(np.linalg.norm(steps, axis=1))
    assert shorter < np.sum(np.linalg.norm(np.diff(free.q, axis=0), axis=1))


def test_a_criterion_lowers_its_cost(panda, arm, circle):
    plain = follow(panda, circle, START)
    middle = follow(panda, circle, START, redundancy="limits")
    able = follow(panda, circle, START, redundancy="manipulability")
    assert off_middle(panda, middle.q[-1]) < off_middle(panda, plain.q[-1]) - 1e-3
    gain = manipulability(arm, able.q) / manipulability(arm, plain.q)
    assert np.mean(gain) > 1.003
    assert np.max(gain) > 1.04


def test_a_cost_of_ones_own_brings_the_joints_back(panda, circle):
    """Without it they end elsewhere: Klein & Huang 1983."""
    plain = follow(panda, circle, START)
    back = follow(panda, circle, START, redundancy=lambda q: 3 * (q - START))
    assert np.max(np.abs(plain.q[-1] - START)) > 0.2
    assert np.max(np.abs(back.q[-1] - START)) < 0.01


def test_more_poses_change_little(panda, circle):
    few = follow(panda, circle, START, samples=51, redundancy="limits")
    many = follow(panda, circle, START, samples=501, redundancy="limits")
    assert np.max(np.abs(many.q[::10] - few.q)) < 0.05


def test_a_joint_stays_at_its_limit_while_the_others_go_on(panda, circle):
    """Half as much room for joint 1 as the path would take."""
    free = follow(panda, circle, START)
    assert np.ptp(free.q[:, 0]) > 0.2
    held = follow(panda, circle, START, samples=201, limits={"q1": (0.05, 0.2)})
    assert held.reason == ""
    assert np.sum(np.abs(held.q[:, 0] - 0.2) < 1e-8) > 10
    assert held.q[:, 0].max() == pytest.approx(0.2, abs=1e-8)
    assert held.residual.max() < 1e-12
    assert np.max(np.abs(np.diff(held.q, axis=0))) < 0.05
    tight = {"q1": (0.05, 0.2), "q2": (-0.5, -0.3)}
    both = follow(panda, circle, START, samples=201, limits=tight)
    assert 0 < both.reached < 200
    before = both.reached + 1
    assert both.reason == f"joint q1 passes its limit 0.2 before pose {before} of 201"


def test_joints_without_limits_have_no_middle(panda, circle):
    plain = follow(panda, circle, START, samples=11, limits=False)
    same = follow(panda, circle, START, samples=11, limits=False, redundancy="limits")
    np.testing.assert_allclose(same.q, plain.q, atol=1e-12)


def test_a_start_beyond_its_limits_is_told(panda, circle):
    found = follow(panda, circle, START, limits={"q1": (0.15, 0.2)})
    assert found.reached == -1
    assert found.reason == "joint q1 passes its limit 0.15 before pose 0 of 101"


def test_a_pose_out_of_reach_is_told(panda, arm):
    T = np.repeat(arm.pose(START)[None], 30, axis=0)
    T[:, 0, 3] += np.linspace(0, 2, 30)
    found = follow(panda, T, START, limits=False)
    assert f"pose {found.reached + 1} of 30 is out of reach" in found.reason


def test_joints_that_are_locked_leave_none_redundant(panda, arm):
    end = START + np.array([0.2, 0.1, 0, 0.3, -0.2, 0.1, 0.4])
    path = np.linspace(START, end, 20)
    found = follow(panda, arm.pose(path), START, locked={"q3": START[2]}, redundancy="limits")
    np.testing.assert_allclose(found.q, path, atol=1e-11)


@pytest.mark.parametrize(
    ("criterion", "count", "function"),
    [
        (None, 30, False),
        (None, 31, False),
        (None, 30, True),
        ("limits", 30, True),
        ("manipulability", 31, False),
    ],
)
def test_a_stretched_elbow_bends_to_the_other_side(criterion, count, function):
    """The arm is as long as it can be half way, at a pose or between two of them."""
    system = human_like_arm()
    own = frame_chain(system, most=7).arm(np.zeros(0))
    start, end = (
        np.array([0.2, 0.7, 0.1, 0.5, -0.3, 0.9, 0.2]),
        START + np.array([0, 1, 0, 0, 0, 0, 0]),
    )
    end[3] = -0.5
    s = np.linspace(0, 1, count)
    joints = start + s[:, None] * (end - start)
    path = (lambda s: own.pose(start + s * (end - start))) if function else own.pose(joints)
    found = follow(system, path, start, samples=count, redundancy=criterion, limits={"q1": (-2, 2)})
    assert found.reason == ""
    assert own.residual(found.q, own.pose(joints)).max() < 1e-12
    np.testing.assert_allclose(found.q[:, 3], joints[:, 3], atol=1e-6)
    speed = np.linalg.norm(np.diff(found.q, axis=0), axis=1)
    assert speed.max() < 1.5 * np.linalg.norm(joints[1] - joints[0])
    assert np.max(np.abs(np.diff(found.q, 2, axis=0))) < 0.01


def test_where_redundant_joints_have_no_room_left_is_told(panda, arm):
    """The joints that made the path went otherwise; away from singular configurations these do."""
    start = np.array([0.4, -0.3, 0.4, -0.6, 0.4, 2.1, 0.4])
    way = np.array([-0.9, 0.6, 0.1, 0.3, 0.2, 0.3, -0.4])

    def path(s):
        return arm.pose(start + s * way)

    found = follow(panda, path, start, samples=21, limits=False)
    assert found.reached == 10
    where = "stopped between poses 10 and 11 of 21, at 0.501"
    assert found.reason.startswith(where)
    assert "beside it no configuration was found for the pose behind" in found.reason
    assert "another redundancy or another start may lead past" in found.reason
    able = follow(panda, path, start, samples=21, limits=False, redundancy="manipulability")
    assert able.reason == ""
    assert able.residual.max() < 1e-12


@pytest.mark.parametrize(
    ("redundancy", "message"),
    [
        ("energy", "redundancy is 'energy'"),
        (3, "redundancy is 3"),
        (lambda q: q[:3], "returned .*; return the gradient of a cost, 7 finite numbers"),
        (lambda q: q + np.nan, "returned .*; return the gradient of a cost, 7 finite numbers"),
    ],
)
def test_wrong_criteria(panda, circle, redundancy, message):
    with pytest.raises(ModelError, match=message):
        follow(panda, circle, START, redundancy=redundancy)
