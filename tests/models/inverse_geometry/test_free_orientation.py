"""Poses of which a part counts: nothing missed, checked by the forward model of the arm alone."""

import numpy as np
import pytest
from support.arm_search import distance, plain_arm
from support.arms import general_5r
from support.catalogue_systems import catalogue_system

import mbs
from mbs.errors import ModelError
from mbs.models.inverse_geometry import free_orientation

START = np.array([0.3, -0.8, 0.4, 0.2, 0.6, 0.1])


def missed(arm, q, T, axis):
    """Position, and the axis where one is not free."""
    difference = np.abs(arm.pose(q) - T)
    part = difference[..., :3, 3].max(axis=-1)
    return part if axis is None else np.maximum(part, difference[..., :3, axis].max(axis=-1))


def searched(arm, T, axis, starts=400):
    """All solutions that Gauss and Newton's steps with differences lead to from random starts."""
    rng = np.random.default_rng(1)
    q = rng.uniform(-np.pi, np.pi, (starts, arm.slides.size))

    def rows(x):
        pose = arm.pose(x) - T
        return np.concatenate([pose[..., :3, 3], pose[..., :3, axis]], axis=-1)

    for _ in range(60):
        r = rows(q)
        J = np.stack([(rows(q + d) - rows(q - d)) / 2e-6 for d in 1e-6 * np.eye(q.shape[1])], -1)
        step = -np.einsum("mij,mj->mi", np.linalg.pinv(J), r)
        size = np.linalg.norm(step, axis=1, keepdims=True)
        q = q + step * np.minimum(1, 0.3 / np.maximum(size, 1e-12))
    kept = []
    for own in q[np.max(np.abs(rows(q)), axis=1) < 1e-9]:
        if not any(distance(arm, own, other) < 1e-4 for other in kept):
            kept.append(own)
    return np.array(kept)


@pytest.mark.parametrize("seed", [0, 1])
def test_five_joints_and_a_tool_that_spins(seed):
    system = general_5r(seed)
    arm = plain_arm(system)
    q = np.random.default_rng(seed).uniform(-2, 2, 5)
    T = arm.pose(q)
    theirs = searched(arm, T, 2)
    T[:3, :2] = T[:3, :2] @ [[0.6, -0.8], [0.8, 0.6]]  # another spin, of which nothing depends
    task = free_orientation(system, "z")
    found = task.solve(T, seed=q)
    assert np.max(np.abs(found[0].q - q)) < 1e-8
    assert np.max(missed(arm, found.q, T, 2)) < 1e-12
    assert max(solution.residual for solution in found) < 1e-12
    apart = distance(arm, theirs[:, None], found.q[None])
    assert len(theirs) >= 2
    assert len(found) == len(theirs)
    assert np.max(np.min(apart, axis=1)) < 1e-6
    many = task.solve_many([T, T])
    assert many.count.tolist() == [len(found)] * 2


def test_six_joints_leave_the_last_one_to_choose():
    """The axis of the tool is the last joint's, which is arbitrary."""
    system = catalogue_system("puma560")
    arm = plain_arm(system)
    T = arm.pose(START)
    task = free_orientation(system, "z")
    found = task.solve(T, locked={"q6": 0.9}, seed=START)
    assert len(found) == 8
    assert found.method == "pieper"
    assert np.max(missed(arm, found.q, T, 2)) < 1e-12
    np.testing.assert_allclose(found[0].q, [*START[:5], 0.9], atol=1e-9)
    many = task.solve_many([T], redundant={"q5": [0.6, 0.5]})
    assert many.samples == 2
    assert np.max(missed(arm, many.of(0), T, 2)) < 1e-12


@pytest.mark.parametrize("given", ["position", "pose"])
def test_three_joints_and_a_position(given):
    """Four configurations, as if a spherical wrist were behind the point."""
    system = catalogue_system("puma560")
    arm = plain_arm(system)
    T = arm.pose(START)
    task = free_orientation(system, "orientation")
    locked = {"q4": 0.2, "q5": 0.6, "q6": 0.1}
    found = task.solve(T[:3, 3] if given == "position" else T, locked=locked, seed=START)
    assert len(found) == 4
    assert found.method == "pieper"
    np.testing.assert_allclose(found[0].q, START, atol=1e-9)
    assert np.max(missed(arm, found.q, T, None)) < 1e-12
    np.testing.assert_array_equal(found.q[:, 3:], np.tile(START[3:], (4, 1)))
    J = np.array(mbs.models.jacobian(system, system.nq)(START))[:3, :3]
    length = task.arm.length
    assert found[0].sigma_min == pytest.approx(np.linalg.svd(J / length)[1][-1], rel=1e-6)
    many = task.solve_many([T[:3, 3]] * 3, locked=locked)
    assert many.count.tolist() == [4, 4, 4]


def test_limits_and_reasons():
    system = catalogue_system("puma560")
    task = free_orientation(system, "z")
    T = plain_arm(system).pose(START)
    inside = task.solve(T, locked={"q6": 0.0}, limits={"q1": (0, 1)})
    assert len(inside) == 3
    assert np.all((inside.q[:, 0] >= 0) & (inside.q[:, 0] <= 1))
    T[0, 3] = 3.0
    nothing = task.solve(T, locked={"q6": 0.0})
    assert "out of reach" in nothing.reason
    assert nothing.nearest.q.shape == (6,)
    reached = plain_arm(system).pose(nothing.nearest.q)
    np.testing.assert_allclose(nothing.nearest.T, reached, atol=1e-12)


def test_joints_beside_the_way_stay():
    system = catalogue_system("two_branch_tree")
    frame = 4
    dgm = mbs.models.transform(system, frame)
    q = np.linspace(0.3, 0.6, system.nq)
    task = free_orientation(system, "orientation", frame)
    T = np.array(dgm(q))
    name = task.arm.names[-1]
    found = task.solve(T[:3, 3], seed=q, locked={name: q[task.indices[-1]]})
    assert np.abs(found[0].q - q).max() < 1e-8
    for solution in found:
        assert np.abs(np.array(dgm(solution.q))[:3, 3] - T[:3, 3]).max() < 1e-12
        others = [k for k in range(system.nq) if k not in task.indices]
        assert solution.q[others].tolist() == q[others].tolist()


def test_a_path_with_a_tool_that_spins():
    """Six joints and a free axis are redundant: joint limits are kept away from."""
    system = catalogue_system("puma560")
    arm = plain_arm(system)
    T0 = arm.pose(START)

    def line(s):
        T = T0.copy()
        T[0, 3] -= 0.15 * s
        return T

    task = free_orientation(system, "z")
    found = task.follow(line, START, samples=21, redundancy="limits")
    assert found.reason == ""
    T = np.array([line(s) for s in np.linspace(0, 1, 21)])
    assert np.max(missed(arm, found.q, T, 2)) < 1e-11
    assert np.max(np.abs(found.q[-1] - START)) > 0.05
    home = task.follow(line, START, samples=21, redundancy=lambda q: q - START)
    assert np.linalg.norm(home.q[-1] - START) < np.linalg.norm(found.q[-1] - START)
    point = free_orientation(system, "orientation")
    positions = T[:, :3, 3]
    along = point.follow(positions, START)
    assert along.reason == ""
    assert np.max(missed(arm, along.q, T, None)) < 1e-11


@pytest.mark.parametrize(("free", "count"), [("z", 16), ("orientation", 8)])
def test_loops_are_closed_in_every_way(free, count):
    """The arm of an SR400 stands on a parallelogram, which closes in two ways."""
    system = catalogue_system("sr400")
    q = mbs.loops.solve(system, {"q1": 0.2, "q2": -1.2, "q4": 0.3, "q5": 0.5, "q6": 0.1, "q7": 0.4})
    closure, pose = mbs.loops.closure_residual(system), mbs.models.transform(system, 6)
    T, task = np.array(pose(q)), free_orientation(system, free, 6)
    held = ("q6",) if free == "z" else ("q4", "q5", "q6")
    locked = {name: float(q[int(name[1]) - 1]) for name in held}
    found = task.solve(T, locked=locked, seed=q)
    assert len(found) == count
    np.testing.assert_allclose(found[0].q, q, atol=1e-12)
    at = slice(2, 4) if free == "z" else slice(3, 4)
    for solution in found:
        assert np.abs(np.array(closure(solution.q))).max() < 1e-12
        np.testing.assert_allclose(np.array(pose(solution.q))[:3, at], T[:3, at], atol=1e-12)
    within = task.solve(T, locked=locked, limits={"q7": (0.3, 0.5)})
    near = [solution for solution in found if 0.3 < solution.q[6] < 0.5]
    assert 0 < len(within) == len(near) < count
    with pytest.raises(ModelError, match="sr400: its loops must be closed too, and follow of"):
        task.follow([T], q, locked=locked)
    with pytest.raises(ModelError, match=r"solve_many .* open chains; call solve for each pose"):
        task.solve_many([T], locked=locked)


@pytest.mark.parametrize(
    ("robot", "given", "message"),
    [
        ("puma560", {"free": "w"}, "free is 'w'"),
        ("puma560", {"frame": "tol"}, "no frame 'tol'"),
        ("delta", {}, "joint platform of the chain is free"),
    ],
)
def test_refusals(robot, given, message):
    with pytest.raises(ModelError, match=message):
        free_orientation(catalogue_system(robot), **given)


def test_wrong_positions_and_criteria():
    system = catalogue_system("puma560")
    task = free_orientation(system, "orientation")
    with pytest.raises(ModelError, match=r"give \(3,\) numbers, or a pose"):
        task.solve([1, 2])
    with pytest.raises(ModelError, match="9 joints are free"):
        task.solve([0.3, 0.1, 0.2])
    with pytest.raises(ModelError, match="return the gradient of a cost, 6 finite numbers"):
        task.follow(lambda s: [0.3, 0.1, 0.2], START, redundancy=lambda q: q[:2])
