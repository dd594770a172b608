"""Many poses at once: nothing missed, nothing wrong, nothing twice."""

import numpy as np
import pytest
from support.arm_search import distance, plain_arm, searched
from support.arms import general_5r, general_6r
from support.catalogue_systems import catalogue_system

import mbs
from mbs.errors import ModelError, NoClosedForm
from mbs.models.geometry import terminal_frame
from mbs.models.inverse_geometry import ManySolutions, solve, solve_many

LOCKED = {"panda": {"q3": 0.4}}


def assembled(name):
    return catalogue_system(name)


def poses(system, count, seed, locked=None):
    """Configurations (count, n) and their poses (count, 4, 4), by an arm that is no part of mbs."""
    arm = plain_arm(system, locked)
    rng = np.random.default_rng(seed)
    slides = rng.uniform(0.1, 0.6, (count, arm.slides.size))
    q = np.where(arm.slides, slides, rng.uniform(-3, 3, (count, arm.slides.size)))
    return arm, q, arm.pose(q)


@pytest.mark.sweep
@pytest.mark.parametrize("name", ["puma560", "tx90", "ur5", "stanford", "scara", "panda"])
def test_every_solution_once(name):
    system, locked = assembled(name), LOCKED.get(name)
    arm, q, T = poses(system, 60, 1, locked)
    many = solve_many(system, T, locked=locked)
    places = [k for k, row in enumerate(system.coordinates) if row.name not in (locked or {})]
    assert many.q.shape == (60, len(many.labels), system.nq)
    for k in range(60):
        ours = many.of(k)[:, places]
        assert np.min(distance(arm, ours, q[k])) < 1e-7
        assert np.max(arm.residual(T[k], ours)) < 1e-12
        assert np.max(np.abs(many.residual[k, many.valid[k]])) < 1e-12
        apart = distance(arm, ours[:, None], ours[None]) + 9 * np.eye(len(ours))
        assert np.min(apart) > 1e-6
    for k in range(2):
        assert many.count[k] == len(searched(arm, T[k]))


def test_machine_code_gives_the_same():
    """From a thousand poses on; the last of them fill no whole call."""
    system = assembled("stanford")
    arm, q, T = poses(system, 1009, 8)
    many, few = solve_many(system, T), solve_many(system, T[-50:])
    assert np.array_equal(many.valid[-50:], few.valid)
    assert np.max(distance(arm, many.q[-50:], few.q)) < 1e-9
    assert np.min(many.count) >= 8
    nearest = np.min(np.where(many.valid, distance(arm, many.q, q[:, None]), 9), axis=1)
    assert np.max(nearest) < 1e-7


def test_rows_are_branches():
    system = assembled("puma560")
    _, _, T = poses(system, 3, 2)
    many = solve_many(system, T, method="pieper")
    from mbs.models.inverse_geometry import function

    igm = function(system, "pieper")
    assert many.labels == igm.labels
    assert len(many) == 3
    for k in range(3):
        for b in range(8):
            assert np.allclose(many.q[k, b], np.array(igm(T[k], b)[0]).ravel(), atol=1e-12)


def singular_configurations():
    """Wrist stretched, nearly so, elbow stretched, hand above the shoulder."""
    rng = np.random.default_rng(3)
    q = rng.uniform(-2, 2, (9, 6))
    q[0:3, 4] = 1e-5, 1e-8, 0.0
    stretched = np.arctan2(0.0203, 0.4331) - np.pi / 2
    q[3:6, 2] = stretched, stretched + 1e-9, stretched + 1e-5
    return q


def test_degenerate_poses_are_as_solve_has_them():
    system = assembled("puma560")
    arm, q = plain_arm(system), singular_configurations()
    T = arm.pose(q)
    many = solve_many(system, T)
    assert many.searched[2]
    assert not np.any(many.searched[6:])
    for k, pose in enumerate(T):
        theirs = solve(system, pose)
        assert many.count[k] == len(theirs)
        assert np.all(arm.residual(pose, many.of(k)) < 1e-12)
        for solution in theirs:
            if solution.family is None:
                assert np.min(distance(arm, many.of(k), solution.q)) < 1e-6


def test_double_root_is_found_once():
    system = assembled("planar_2r")
    T = np.array([np.array(mbs.models.direct_geometry(system)([0.3, x])) for x in (0.0, 0.4)])
    many = solve_many(system, T)
    assert many.count.tolist() == [1, 1]


def test_out_of_reach_and_off_the_manifold():
    puma, scara = assembled("puma560"), assembled("scara")
    far = np.eye(4)
    far[:3, 3] = [2.0, 0.5, 0.3]
    many = solve_many(puma, [far, far])
    assert many.count.tolist() == [0, 0]
    assert np.all(np.isfinite(many.q))
    assert many.of(0).shape == (0, 6)
    _, _, T = poses(scara, 2, 4)
    c, s = np.cos(1e-5), np.sin(1e-5)
    T[1, :3, :3] = T[1, :3, :3] @ [[1, 0, 0], [0, c, -s], [0, s, c]]
    assert solve_many(scara, T).count.tolist() == [2, 0]


def test_limits_leave_out_and_wind():
    system = assembled("puma560")
    _, _, T = poses(system, 40, 5)
    free, held = solve_many(system, T), solve_many(system, T, limits=True)
    low, high = (np.array([row.limits[k] for row in system.coordinates]) for k in (0, 1))
    assert 0 < np.sum(held.count) < np.sum(free.count)
    for k in range(40):
        inside = held.of(k)
        assert np.all((inside >= low - 1e-9) & (inside <= high + 1e-9))
        assert held.count[k] == len(solve(system, T[k], limits=True))
    wound = solve_many(system, T, limits={"q6": (7.0, 13.5)})
    assert np.all(wound.q[wound.valid][:, 5] >= 7 - 1e-9)
    assert np.sum(wound.count) > 0


def test_without_a_closed_form_the_general_method_solves():
    system = general_6r(0)
    arm, q, T = poses(system, 2, 6)
    many = solve_many(system, T)
    assert not np.any(many.searched)
    for k in range(2):
        assert np.min(distance(arm, many.of(k), q[k])) < 1e-7
        assert np.all(arm.residual(T[k], many.of(k)) < 1e-12)
    with pytest.raises(NoClosedForm, match="pieper: "):
        solve_many(system, T, method="pieper")


def test_the_general_method_leaves_neighbours_of_singular_configurations_to_the_search():
    """On both sides of the bound within a factor of four, and where it misses one of eight."""
    system = assembled("crx10")
    q = np.tile([-0.59762315, 1.06628932, 0.56258902, 2.20500488, 0.07701433, 1.11838127], (3, 1))
    q[:, 4] += 1.5e-3, 1.5e-4, 3e-6
    arm = plain_arm(system)
    T = arm.pose(q)
    many = solve_many(system, T)
    assert many.searched.tolist() == [False, True, True]
    assert many.count.tolist() == [8, 8, 8]
    answers = [solve(system, pose) for pose in T]
    assert [len(answer) for answer in answers] == [8, 8, 8]
    least = [min(solution.sigma_min for solution in answer) for answer in answers]
    assert least == pytest.approx([2.7e-4, 2.7e-5, 5.4e-7], rel=0.1)
    assert np.min(distance(arm, answers[2].q, q[2])) < 1e-8


def test_repair_solves_what_is_in_doubt():
    asked = []

    def repair(arm, T):
        asked.append(T)
        return np.full((9, 6), 0.25)

    system = assembled("puma560")
    arm, q = plain_arm(system), singular_configurations()
    many = solve_many(system, arm.pose(q[[2, 7]]), repair=repair)
    assert len(asked) == 1
    assert many.q.shape == (2, 9, 6)
    assert many.count.tolist() == [9, 8]
    assert many.labels[8] == ""
    assert isinstance(many, ManySolutions)


def test_parameters():
    m = mbs.Mechanism("slide", gravity=(0, 0, 0))
    body = m.add(mbs.components.Body("arm", mass=0))
    hand = m.add(mbs.components.Body("hand", mass=0))
    m.connect(m.world, mbs.components.Revolute("q1", axis="z"), body)
    m.connect(body.at("L", 0, 0), mbs.components.Revolute("q2", axis="z"), hand)
    m.add_frame("tool", hand.at(0.5, 0, 0))
    system = m.assemble()
    T = np.array(mbs.models.direct_geometry(system)([0.3, 0.8], [0.7]))[None]
    many = solve_many(system, T, parameters={"L": 0.7})
    assert np.allclose(many.of(0), [[0.3, 0.8]])
    assert solve_many(system, T, parameters={"L": 0.5}).count[0] == 0


def test_robots_with_loops_are_as_solve_has_them():
    system = assembled("five_bar")
    configuration = np.array(system.configuration)
    T = np.array(mbs.models.transform(system, terminal_frame(system))(configuration))
    many = solve_many(system, [T, T])
    assert many.count.tolist() == [len(solve(system, T))] * 2
    assert np.min(np.max(np.abs(many.of(1) - configuration), axis=1)) < 1e-9


def test_five_joints():
    system = general_5r(0)
    arm, q, T = poses(system, 2, 7)
    many = solve_many(system, T)
    for k in range(2):
        assert np.min(distance(arm, many.of(k), q[k])) < 1e-7


def test_wrong_questions():
    system = assembled("puma560")
    with pytest.raises(ModelError, match="method is 'fast'"):
        solve_many(system, np.eye(4)[None], method="fast")
    with pytest.raises(ModelError, match=r"give them as \(N, 4, 4\)"):
        solve_many(system, np.eye(4))
    bad = np.stack([np.eye(4), np.diag([1, 1, 2.0, 1])])
    with pytest.raises(ModelError, match="pose 1 of 2"):
        solve_many(system, bad)
    with pytest.raises(ModelError, match="q9"):
        solve_many(system, np.eye(4)[None], limits={"q9": (0, 1)})
    assert len(solve_many(system, np.empty((0, 4, 4)))) == 0
