"""Paths followed on one branch: found again joint by joint, and stopped where the branch ends."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.closed_forms.arm_search import search
from mbs.errors import ModelError
from mbs.models.inverse_geometry.chain import frame_chain
from mbs.models.inverse_geometry.follow import follow

ELBOW_UP = np.array([0.3, -0.8, 0.4, 0.2, 0.6, 0.1])


@pytest.fixture(scope="module")
def puma():
    return catalogue_system("puma560")


def poses(system, frame, configurations):
    T = mbs.models.transform(system, frame)
    return np.array([np.array(T(q)) for q in configurations])


def line(start, end, count):
    return np.linspace(0, 1, count)[:, None] * (np.asarray(end) - start) + start


def turned(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


@pytest.mark.parametrize("count", [5, 60])
def test_a_joint_path_is_found_again(puma, count):
    end = ELBOW_UP + np.array([1.2, 0.5, -0.9, 1.0, -0.4, 2.0])
    path = line(ELBOW_UP, end, count)
    found = follow(puma, poses(puma, 6, path), ELBOW_UP, limits=False)
    assert (found.reached, found.reason) == (count - 1, "")
    assert found.residual.max() < 1e-13
    if count == 60:
        np.testing.assert_allclose(found.q, path, atol=1e-12)


def test_angles_go_on_beyond_half_a_turn(puma):
    path = line(ELBOW_UP, ELBOW_UP + np.array([7.0, 0, 0, 0, 0, -9.0]), 40)
    found = follow(puma, poses(puma, 6, path), ELBOW_UP, limits=False)
    np.testing.assert_allclose(found.q, path, atol=1e-11)


@pytest.mark.parametrize("seed", range(4))
def test_the_branch_is_kept(puma, seed):
    """The determinant of the Jacobian keeps its sign, and the end is the start when walked back."""
    rng = np.random.default_rng(seed)
    start = ELBOW_UP + rng.uniform(-0.2, 0.2, 6)
    path = poses(puma, 6, line(start, start + rng.uniform(-0.9, 0.9, 6), 12))
    path = np.concatenate([path, path[-2::-1]])
    found = follow(puma, path, start, limits=False)
    arm = frame_chain(puma, 6).arm(np.zeros(0))
    signs = np.sign(np.linalg.det(arm.pose_and_jacobian(found.q)[1]))
    assert np.all(signs == signs[0])
    if found.reason == "":
        np.testing.assert_allclose(found.q[-1], start, atol=1e-10)
    else:
        assert "singular" in found.reason


@pytest.mark.parametrize("count", [3, 20, 21])
def test_through_the_wrist_singularity_it_stops(puma, count):
    """A pose in which the wrist is straight may be among the poses, or between two of them."""
    end = ELBOW_UP.copy()
    end[4] = -0.6
    found = follow(puma, poses(puma, 6, line(ELBOW_UP, end, count)), ELBOW_UP)
    last = (count - 1) // 2 - count % 2
    assert found.reached == last
    assert found.reason.startswith(f"stopped between poses {last} and {last + 1} of {count}: singu")
    assert "q5 = 0.000, smallest singular value " in found.reason
    assert float(found.reason.rsplit(" ", 1)[1]) < 1e-6
    assert abs(found.stopped_at[4]) < 1e-5
    np.testing.assert_allclose(found.q[:, 3], ELBOW_UP[3], atol=1e-9)


@pytest.mark.parametrize("beside", [1e-4, 1e-2])
def test_beside_the_wrist_singularity_the_wrist_swings_round(puma, beside):
    end = ELBOW_UP.copy()
    end[4] = -0.6
    path = poses(puma, 6, line(ELBOW_UP, end, 20))
    tilt = np.eye(4)
    tilt[1:3, 1:3] = turned(beside)[:2, :2]
    found = follow(puma, path @ tilt, ELBOW_UP, limits=False)
    assert found.reason == ""
    assert np.all(found.q[:, 4] > 0)
    assert found.residual.max() < 1e-13
    assert abs(found.q[-1, 3] - found.q[0, 3]) == pytest.approx(np.pi, abs=0.1)


def test_a_pose_too_far_is_out_of_reach(puma):
    """A search from many starts finds configurations for the last pose reached, and none for the
    next."""
    path = np.repeat(poses(puma, 6, [ELBOW_UP]), 30, axis=0)
    path[:, 0, 3] += np.linspace(0, 2, 30)
    found = follow(puma, path, ELBOW_UP, limits=False)
    assert found.reason.startswith(f"pose {found.reached + 1} of 30 is out of reach: the nearest")
    assert len(found.q) == found.reached + 1
    last, beyond = path[found.reached], path[found.reached + 1]
    arm = frame_chain(puma, 6).arm(np.zeros(0))
    assert len(search(arm, last)) > 0
    assert len(search(arm, beyond)) == 0
    away = float(found.reason.split(" m away")[0].rsplit(" ", 1)[1])
    assert 0 < away < 2 / 29


def test_a_limit_stops_it(puma):
    end = ELBOW_UP + np.array([0, 2.0, 0, 0, 0, 0])
    found = follow(puma, poses(puma, 6, line(ELBOW_UP, end, 21)), ELBOW_UP)
    assert found.reason == "joint q2 passes its limit 0.785398 before pose 16 of 21"
    assert found.q[-1, 1] == pytest.approx(0.7)
    assert found.stopped_at[1] == pytest.approx(np.pi / 4, abs=1e-6)
    free = follow(puma, poses(puma, 6, line(ELBOW_UP, end, 21)), ELBOW_UP, limits=False)
    assert free.reason == ""
    own = follow(puma, poses(puma, 6, line(ELBOW_UP, end, 21)), ELBOW_UP, limits={"q2": (-1, 0)})
    assert own.reason == "joint q2 passes its limit 0 before pose 9 of 21"


def test_a_function_is_a_path(puma):
    start = ELBOW_UP - np.array([0, 0, 0.8, 0, 0, 0])
    T0 = poses(puma, 6, [start])[0]

    def circle(s):
        T = T0.copy()
        T[:3, 3] += 0.05 * np.array([np.cos(2 * np.pi * s) - 1, np.sin(2 * np.pi * s), 0])
        return T

    found = follow(puma, circle, SimpleNamespace(q=start), samples=9, limits=False)
    assert found.reason == ""
    assert found.reached == 8
    np.testing.assert_allclose(found.q[-1], start, atol=1e-11)
    np.testing.assert_allclose(poses(puma, 6, found.q)[3], circle(3 / 8), atol=1e-13)


def test_start_near_the_first_pose(puma):
    path = poses(puma, 6, line(ELBOW_UP, ELBOW_UP + 0.3, 4))
    names = {f"q{k + 1}": x for k, x in enumerate(ELBOW_UP + 0.05)}
    found = follow(puma, path, names)
    np.testing.assert_allclose(found.q[0], ELBOW_UP, atol=1e-12)


@pytest.mark.parametrize(("robot", "frame"), [("scara", None), ("two_branch_tree", 4)])
def test_chains_of_fewer_than_six_joints(robot, frame):
    """Between the poses of a path the straight line leaves what the joints can reach."""
    system = catalogue_system(robot)
    own = frame_chain(system, frame)
    start = np.linspace(0.3, 0.6, system.nq)
    end = start.copy()
    end[list(own.indices)] += np.linspace(0.5, -0.4, len(own.indices))
    path = line(start, end, 9)
    T = poses(system, own.frame, path)
    found = follow(system, T, start, frame, limits=False)
    np.testing.assert_allclose(found.q, path, atol=1e-9)
    T[5:, :3, :3] = T[5:, :3, :3] @ np.diag([1, -1, -1])
    off = follow(system, T, start, frame, limits=False)
    assert off.reached == 4
    assert "pose 5 of 9 is not one that the joints can take: the nearest" in off.reason


@pytest.mark.parametrize(
    ("robot", "frame"),
    [("sr400", 6), ("akr3000", 10), ("five_bar", "tool"), ("delta", "tool")],
)
def test_closed_loops_stay_closed(robot, frame):
    system = catalogue_system(robot)
    names = [system.speeds[k].name for k in system.free]
    places = [[c.name for c in system.coordinates].index(name) for name in names]
    start = np.array(system.configuration)[places]
    away = 0.03 if robot == "akr3000" else 0.3
    end = start + away * np.cos(np.arange(len(names)))
    path = [mbs.loops.solve(system, dict(zip(names, x, strict=True))) for x in line(start, end, 6)]
    found = follow(system, poses(system, frame, path)[1:], path[1], frame, limits=False)
    assert found.reason == ""
    np.testing.assert_allclose(found.q, path[1:], atol=1e-8)
    assert max(np.abs(np.array(mbs.loops.closure(system)(q))).max() for q in found.q) < 1e-12
    assert found.residual.max() < 1e-12


def test_joints_that_the_frame_does_not_see_stay_where_they_start():
    system = catalogue_system("sr400")
    motors = {"q1": 0.2, "q2": -1.2, "q7": 0.1, "q4": 0.5, "q5": -0.6, "q6": 0.7}
    start = mbs.loops.solve(system, motors)
    end = mbs.loops.solve(system, motors | {"q1": 0.5, "q2": -1.5, "q7": 0.3})
    found = follow(system, poses(system, 3, [start, end]), start, 3, limits=False)
    np.testing.assert_allclose(found.q[-1], end, atol=1e-9)
    np.testing.assert_array_equal(found.q[-1][3:6], start[3:6])


def test_locked_joints_stay():
    system = catalogue_system("sr400")
    start = mbs.loops.solve(system, {"q4": 0.5, "q5": -0.6})
    end = mbs.loops.solve(system, {"q1": 0.3, "q4": 0.5, "q5": -0.4})
    T = poses(system, 6, [start, end])
    found = follow(system, T, start, 6, locked={"q4": 0.5}, limits=False)
    np.testing.assert_allclose(found.q[-1], end, atol=1e-9)
    off = follow(system, T, start, 6, locked={"q4": 0.6}, limits=False)
    assert off.reached == -1
    assert "pose 0 of 2" in off.reason


def test_too_few_joints_for_a_far_pose_stop(puma):
    """Steps towards a pose that three joints cannot take only creep on."""
    far = np.array(mbs.models.transform(puma, 6)(ELBOW_UP))
    found = follow(puma, [far], ELBOW_UP, 3, limits=False)
    assert found.reached == -1
    assert found.reason.startswith("pose 0 of 1 is out of reach: the nearest")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"path": np.zeros((0, 4, 4))}, r"the path has no pose"),
        ({"path": [np.eye(4), np.eye(3)]}, r"pose 1 of 2"),
        ({"path": lambda s: np.eye(3)}, r"of shape \(3, 3\)"),
        ({"path": lambda s: np.eye(4), "samples": 1}, r"samples is 1; give a whole number"),
        ({"start": [0, 1]}, r"start is \[0, 1\]; give 6 positions"),
        ({"start": "home"}, r"start is 'home'"),
        ({"start": {"q9": 0}}, r"no coordinate 'q9'"),
        ({"frame": "tol"}, r"no frame 'tol'"),
        ({"limits": {"q9": (0, 1)}}, r"limits are given for 'q9'"),
        ({"limits": {"q1": 3}}, r"limits of q1 are 3; give \(lowest, highest\)"),
        ({"limits": {"q1": (2, 1)}}, r"limits of q1 are \(2, 1\)"),
        ({"limits": 3}, r"limits is 3; give True"),
        ({"locked": {"x": 0}}, r"no coordinate 'x'"),
        ({"locked": "q1", "start": {}}, r"position is 'q1'"),
    ],
)
def test_refusals(puma, change, message):
    given = {"path": [np.eye(4)], "start": ELBOW_UP, **change}
    path, start = given.pop("path"), given.pop("start")
    with pytest.raises(ModelError, match=message):
        follow(puma, path, start, **given)
