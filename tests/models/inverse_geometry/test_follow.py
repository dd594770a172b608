"""Paths followed on one branch: found again joint by joint, and stopped where the branch ends."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.sweeps import slow

import mbs
from mbs.closed_forms.arm_search import search
from mbs.errors import ModelError
from mbs.models.inverse_geometry import follow
from mbs.models.inverse_geometry.chain import frame_chain

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
def test_there_and_back(puma, seed):
    """On one of the ways the wrist becomes straight, and joints go on as they moved; else the
    determinant of the Jacobian keeps its sign."""
    rng = np.random.default_rng(seed)
    start = ELBOW_UP + rng.uniform(-0.2, 0.2, 6)
    way = line(start, start + rng.uniform(-0.9, 0.9, 6), 12)
    way = np.concatenate([way, way[-2::-1]])
    found = follow(puma, poses(puma, 6, way), start, limits=False)
    assert found.reason == ""
    np.testing.assert_allclose(found.q[-1], start, atol=1e-10)
    arm = frame_chain(puma, 6).arm(np.zeros(0))
    signs = np.sign(np.linalg.det(arm.pose_and_jacobian(found.q)[1]))
    if np.any(signs != signs[0]):
        np.testing.assert_allclose(found.q, way, atol=1e-10)


SHOULDER = np.array([0.3, 0.3, np.arcsin(np.cos(0.3)) - 0.3, 0.5, 0.4, 0.2])
SINGULAR = {
    "wrist": [0.3, 0.4, -0.2, 0.5, 0.0, 0.2],
    "shoulder": SHOULDER,
    "shoulder and wrist": [*SHOULDER[:4], 0.0, SHOULDER[5]],
    "elbow": [0.3, 0.3, np.pi / 2, 0.5, 0.4, 0.2],
    "elbow and wrist": [0.3, 0.3, np.pi / 2, 0.5, 0.0, 0.2],
}


@pytest.mark.parametrize("name", SINGULAR)
def test_a_constant_path_stays_at_a_singular_configuration(name):
    rx90, q = catalogue_system("rx90"), np.array(SINGULAR[name])
    found = follow(rx90, poses(rx90, 6, [q] * 4), q, limits=False)
    assert (found.reached, found.reason) == (3, "")
    np.testing.assert_allclose(found.q, [q] * 4, rtol=0, atol=1e-15)
    assert found.residual.max() < 1e-13


@pytest.mark.parametrize(
    "name", ["wrist", "shoulder", "shoulder and wrist", slow("elbow"), slow("elbow and wrist")]
)
def test_a_seed_on_a_self_motion_stands_for_it(name):
    rx90, q = catalogue_system("rx90"), np.array(SINGULAR[name])
    (T,) = poses(rx90, 6, [q])
    first = mbs.models.inverse_geometry.solve(rx90, T, 6, seed=q, limits=False)[0]
    np.testing.assert_allclose(first.q, q, rtol=0, atol=1e-14)


def test_a_path_that_leaves_a_singular_configuration_stops_where_it_leaves(puma):
    start = ELBOW_UP.copy()
    start[4] = 0.0
    way = [start, start, *line(start, ELBOW_UP, 10)]
    found = follow(puma, poses(puma, 6, way), start, limits=False)
    assert found.reached == 2
    assert "between poses 2 and 3 of 12" in found.reason


def test_a_singular_start_names_a_start_from_which_the_path_goes_on(puma):
    start = ELBOW_UP.copy()
    start[4] = 0.0
    T = poses(puma, 6, line(start, ELBOW_UP + np.array([0.05, 0.05, -0.05, 0, 0, 0]), 10))
    found = follow(puma, T, start, limits=False)
    assert found.reached == 0
    text = found.reason.partition("from pose 1 on with a start on one of them, such as ")[2]
    other = [float(value) for value in text.partition(", or another solution")[0].split(",")]
    further = follow(puma, T[1:], other, limits=False)
    assert (further.reached, further.reason) == (8, "")


@pytest.mark.parametrize("count", [3, 20, 21])
@pytest.mark.parametrize("function", [False, True])
def test_through_a_straight_wrist_it_goes_on(puma, count, function):
    """A pose in which the wrist is straight may be among the poses, or between two of them."""
    end = ELBOW_UP.copy()
    end[4] = -0.6
    path = line(ELBOW_UP, end, count)
    T = poses(puma, 6, path)
    dgm = mbs.models.transform(puma, 6)

    def pose(s):
        return np.array(dgm(ELBOW_UP + s * (end - ELBOW_UP)))

    found = follow(puma, pose if function else T, ELBOW_UP, samples=count)
    assert found.reason == ""
    np.testing.assert_allclose(found.q, path, atol=1e-7)
    assert found.residual.max() < 1e-12
    least = found.singular_values[count // 2]
    assert least < 1e-6 if count % 2 else least > 1e-3


def smooth_motion(seed, count):
    """Joints on curves along which the wrist is straight once or oftener."""
    rng = np.random.default_rng(seed)
    slope, wave, phase = rng.uniform(-1, 1, 6), rng.uniform(-0.6, 0.6, 6), rng.uniform(0, 6, 6)
    s = np.linspace(0, 1, count)[:, None]
    return [0.3, -0.8, 0.4, 0.2, 0.1, 0.1] + slope * (s - 0.5) + wave * np.sin(2 * s + phase)


@pytest.mark.parametrize("robot", ["puma560", "ur5"])
@pytest.mark.parametrize("count", [18, 40, 300])
@pytest.mark.parametrize("seed", [0, 2, 4])
def test_joints_that_move_smoothly_are_found_again(robot, count, seed):
    """Step by step, and in runs of a closed form; of the UR5 the elbow is stretched too."""
    system = catalogue_system(robot)
    path = smooth_motion(seed, count)
    assert np.ptp(np.sign(path[:, 4])) > 0
    found = follow(system, poses(system, 6, path), path[0], limits=False)
    assert found.reason == ""
    np.testing.assert_allclose(found.q, path, atol=1e-6)
    assert found.residual.max() < 1e-12


@pytest.mark.parametrize("count", [9, 40])
def test_a_jump_is_told(puma, count):
    """Behind the straight wrist the path leads aside: joint 4 would have to turn by 80 degrees."""
    straight, aside = ELBOW_UP.copy(), ELBOW_UP.copy()
    straight[4] = 0.0
    turned_wrist = straight + np.array([0, 0, 0, 1.4, 0, -1.4])
    aside = turned_wrist + np.array([0, 0, 0, 0, 0.5, 0])
    path = np.concatenate([line(ELBOW_UP, straight, count), line(turned_wrist, aside, count)[1:]])
    found = follow(puma, poses(puma, 6, path), ELBOW_UP)
    last, every = count - 2, 2 * count - 1
    assert found.reached == last
    where = f"stopped between poses {last} and {last + 1} of {every}, at 0.5 of the path: singular"
    assert found.reason.startswith(f"{where} configuration, q5 = 0.000, smallest singular value ")
    assert "no configuration behind it goes on smoothly, in the nearest one q" in found.reason
    assert " 80.21 degrees away" in found.reason
    assert abs(found.stopped_at[4]) < 1e-5


@pytest.mark.parametrize("robot", ["puma560", "ur5"])
def test_many_poses_are_followed_as_few(robot):
    """A circle, from its closed form in runs, and step by step as a function."""
    system = catalogue_system(robot)
    start = np.array([0.3, -0.8, -0.4, 0.2, 0.6, 0.1])
    if robot == "ur5":
        start = np.array([0.3, -1.2, 1.8, -0.5, 1.0, 0.1])
    T0 = poses(system, 6, [start])[0]

    def circle(s):
        T = T0.copy()
        T[:2, 3] += 0.08 * np.array([np.cos(2 * np.pi * s) - 1, np.sin(2 * np.pi * s)])
        return T

    T = [circle(s) for s in np.linspace(0, 1, 401)]
    many = follow(system, T, start, limits=False)
    few = follow(system, circle, start, samples=41, limits=False)
    assert many.reason == few.reason == ""
    np.testing.assert_allclose(many.q[::10], few.q, atol=1e-11)
    np.testing.assert_allclose(many.singular_values[::10], few.singular_values, rtol=1e-9)
    np.testing.assert_allclose(many.q[-1], start, atol=1e-11)
    assert many.residual.max() < 1e-12
    path = line(start, start + np.array([9, 0, 0, 0, 0, 0]), 400)
    turned_round = follow(system, poses(system, 6, path), start, limits=False)
    assert turned_round.q[-1, 0] == pytest.approx(start[0] + 9)


def test_a_limit_stops_a_run(puma):
    end = ELBOW_UP + np.array([0, 2.0, 0, 0, 0, 0])
    found = follow(puma, poses(puma, 6, line(ELBOW_UP, end, 401)), ELBOW_UP)
    assert found.reason == "joint q2 passes its limit 0.785398 before pose 318 of 401"
    assert np.all(found.q[:, 1] < np.pi / 4)


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


def test_a_function_may_write_its_poses_over_each_other(puma):
    """In a run of the closed form, as given poses are: to the last digit."""
    start, T = ELBOW_UP - np.array([0, 0, 0.8, 0, 0, 0]), np.empty((4, 4))
    T0 = poses(puma, 6, [start])[0]

    def lift(s):
        T[:] = T0
        T[2, 3] += 0.1 * s
        return T

    found = follow(puma, lift, start, samples=40, limits=False)
    same = follow(puma, [lift(s).copy() for s in np.linspace(0, 1, 40)], start, limits=False)
    assert found.reason == ""
    np.testing.assert_array_equal(found.q, same.q)
    with pytest.raises(ModelError, match=r"pose 20 of 40, counted from 0: .* rigid"):
        follow(puma, lambda s: lift(s) * (1 + (s > 0.5)), start, samples=40)


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
    names = [system.velocity_coordinates[k].name for k in system.chosen_coordinates]
    places = [[c.name for c in system.coordinates].index(name) for name in names]
    start = np.array(system.configuration)[places]
    away = 0.03 if robot == "akr3000" else 0.3
    end = start + away * np.cos(np.arange(len(names)))
    path = [mbs.loops.solve(system, dict(zip(names, x, strict=True))) for x in line(start, end, 6)]
    found = follow(system, poses(system, frame, path)[1:], path[1], frame, limits=False)
    assert found.reason == ""
    np.testing.assert_allclose(found.q, path[1:], atol=1e-8)
    assert (
        max(np.abs(np.array(mbs.loops.closure_residual(system)(q))).max() for q in found.q) < 1e-12
    )
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
