"""The one entry: every configuration of a pose, on robots whose answer is known beforehand."""

import pickle
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.arms import general_6r
from support.catalogue_systems import catalogue_system

import mbs
from mbs.errors import ModelError, NoClosedForm
from mbs.models.inverse_geometry import solve
from mbs.models.inverse_geometry._solve import solve_rigid
from mbs.models.inverse_geometry.chain import frame_chain, target_pose

ANGLES = st.floats(-3.1, 3.1)
ROBOTS = {
    "puma560": (6, ()),
    "rx90": (6, ()),
    "stanford": (6, (2,)),
    "scara": (4, (3,)),
    "planar_2r": (2, ()),
}


@cache
def assembled(name):
    return catalogue_system(name)


@cache
def dgm(name):
    return mbs.models.direct_geometry(assembled(name))


def pose(name, q):
    return np.array(dgm(name)(q))


def nearest_of(system, answer, q):
    turns = np.array([c.kind == "revolute" for c in system.coordinates])
    way = answer.q - q
    return np.min(np.max(np.abs(np.where(turns, np.mod(way + np.pi, 2 * np.pi) - np.pi, way)), 1))


def test_crossing_self_motions_are_listed_each():
    """All joints of a Stanford arm at zero but the last: four self-motions meet there."""
    q = np.array([0, 0, 0, 0, 0, 0.25])
    answer = solve(assembled("stanford"), pose("stanford", q))
    families = [solution.family for solution in answer]
    assert len(families) == 4
    assert all(family is not None for family in families)
    assert any(family.contains(q) for family in families)


@settings(max_examples=12, deadline=None, derandomize=True)
@given(st.sampled_from(sorted(ROBOTS)), st.lists(ANGLES, min_size=6, max_size=6))
def test_the_answer_contains_the_configuration_that_made_the_pose(name, angles):
    size, slides = ROBOTS[name]
    q = np.array(angles[:size])
    q[list(slides)] *= 0.2
    T = pose(name, q)
    answer = solve(assembled(name), T)
    for solution in answer:
        assert np.max(np.abs(pose(name, solution.q) - T)) < 1e-12
    by_family = [s.family for s in answer if s.family is not None]
    sigma = min((s.sigma_min for s in answer), default=0.0)
    close = nearest_of(assembled(name), answer, q) < 1e-9 / max(sigma, 1e-7)
    assert close or any(family.contains(q) for family in by_family)


@pytest.mark.parametrize(
    ("name", "q", "count", "method"),
    [
        ("puma560", [0.3, -0.5, 0.7, 0.4, 0.9, 0.2], 8, "pieper"),
        ("stanford", [0.3, 0.5, 0.2, 0.1, 0.4, 0.4], 8, "pieper"),
        ("scara", [0.3, 0.5, 0.2, -0.1], 2, "paul"),
        ("planar_2r", [0.4, 0.6], 1, "paul"),
    ],
)
def test_a_closed_form_gives_all(name, q, count, method):
    answer = solve(assembled(name), pose(name, q))
    assert len(answer) == count
    assert answer.method == method
    assert answer.q.shape == (count, assembled(name).nq)
    assert answer.reason == ""
    assert answer.nearest is None
    assert [s.multiplicity for s in answer] == [1] * count


def test_methods_agree():
    T = pose("puma560", [0.3, -0.5, 0.7, 0.4, 0.9, 0.2])
    expected = solve(assembled("puma560"), T).q
    for method in ("pieper", "general", "search"):
        found = solve(assembled("puma560"), T, method=method)
        assert found.method == method
        assert len(found) == 8
        for q in expected:
            assert nearest_of(assembled("puma560"), found, q) < 1e-10


def test_a_general_arm_is_solved_by_elimination():
    system = general_6r(3)
    q = np.array([0.4, -0.8, 1.1, 0.3, -0.6, 0.9])
    T = np.array(mbs.models.direct_geometry(system)(q))
    answer = solve(system, T)
    assert answer.method == "general"
    assert nearest_of(system, answer, q) < 1e-9
    assert len(answer) == len(solve(system, T, method="search"))
    assert len({s.branch for s in answer}) == len(answer)
    with pytest.raises(NoClosedForm):
        solve(system, T, method="pieper")


def test_a_double_root_is_listed_once():
    q = [0.3, 0.0, 0.2, -0.1]
    answer = solve(assembled("scara"), pose("scara", q))
    assert [s.multiplicity for s in answer] == [2]
    assert answer[0].q == pytest.approx(q, abs=1e-9)
    assert answer[0].residual < 1e-15
    assert answer[0].sigma_min < 1e-9


@pytest.mark.parametrize("beyond", [1e-4, -1e-4])
def test_the_boundary_of_the_reach(beyond):
    """Two configurations within the boundary, none beyond it."""
    T = pose("scara", [0.3, 0.0, 0.2, -0.1])
    T[:2, 3] *= 1 + beyond
    answer = solve(assembled("scara"), T)
    assert len(answer) == (0 if beyond > 0 else 2)
    if beyond > 0:
        assert answer.nearest.distance == pytest.approx(0.8 * beyond, rel=1e-6)


def test_a_seed_sorts_and_winds():
    system = assembled("puma560")
    q = np.array([0.3, -0.5, 0.7, 0.4, 0.9, 0.2])
    limits = {"q2": None, "q4": None, "q6": (-20, 20)}
    for own in solve(system, pose("puma560", q)):
        seed = own.q + np.array([0.01, 0.02, 0, 0, 0, 4 * np.pi])
        answer = solve(system, pose("puma560", q), seed=seed, limits=limits)
        assert np.max(np.abs(answer[0].q - seed)) < 0.03
        far = [np.linalg.norm(s.q - seed) for s in answer]
        assert far == sorted(far)
    by_name = solve(system, pose("puma560", q), seed={"q1": q[0], "q2": q[1]})
    assert len(by_name) == 8


def test_closest():
    q = np.array([0.3, -0.5, 0.7, 0.4, 0.9, 0.2])
    answer = solve(assembled("puma560"), pose("puma560", q))
    for solution in answer:
        assert answer.closest(solution.q + 0.01).q == pytest.approx(solution.q, abs=1e-12)
    with pytest.raises(ModelError, match="5 values"):
        answer.closest(q[:5])
    for wrong in ("home", np.full(6, np.nan), {"q1": 0.1}):
        with pytest.raises(ModelError, match="give a finite number for each coordinate"):
            answer.closest(wrong)


def test_a_locked_joint_of_a_redundant_arm():
    rows = [
        {"antecedent": k, "joint": "revolute", "d": 0.1 * k, "alpha": (-1) ** k * 1.5, "r": 0.3}
        for k in range(7)
    ]
    system = mbs.load({"name": "seven", "frame": rows}).assemble()
    q = np.array([0.2, -0.4, 0.6, 0.5, -0.3, 0.8, 0.1])
    T = np.array(mbs.models.direct_geometry(system)(q))
    with pytest.raises(ModelError, match=r"lock 1 of them with locked=\{'q3': 0\}"):
        solve(system, T)
    answer = solve(system, T, locked={"q3": 0.6})
    assert nearest_of(system, answer, q) < 1e-9
    assert np.all(answer.q[:, 2] == 0.6)


def test_parameters_of_the_call_count():
    rows = [
        {"antecedent": 0, "joint": "revolute"},
        {"antecedent": 1, "joint": "revolute", "d": "L1"},
        {"antecedent": 2, "joint": "prismatic", "d": "L2"},
    ]
    system = mbs.load({"name": "arm", "frame": rows, "parameters": {"L1": 1.0}}).assemble()
    values, q = {"L1": 0.7, "L2": 0.4}, [0.3, 0.8, 0.2]
    model = mbs.models.direct_geometry(system)
    T = np.array(model(q, [values[p.name] for p in system.parameters]))
    with pytest.raises(ModelError, match="'L2' has no value"):
        solve(system, T)
    answer = solve(system, T, parameters=values)
    assert nearest_of(system, answer, q) < 1e-10
    assert len(solve(system, T, parameters={"L1": 0.7, "L2": 0.5})) == 0


def test_joints_that_the_frame_does_not_depend_on_stay():
    system = assembled("two_branch_tree")
    name = system.links[3].number
    seed = np.linspace(0.1, 0.7, system.nq)
    T = np.array(mbs.models.transform(system, name)(seed))
    answer = solve(system, T, name, seed=seed)
    assert answer[0].q == pytest.approx(seed, abs=1e-9)
    path = set(system.tree.path(name - 1))
    others = [k for k in range(system.nq) if k not in path]
    assert others
    assert np.all(answer.q[:, others] == seed[others])


def test_a_robot_with_a_loop():
    system = assembled("sr400")
    T = np.array(mbs.models.direct_geometry(system)(np.array([0.2, 0.3, 0.5, 0.4, -0.3, 0.6])))
    answer = solve(system, T)
    assert len(answer) > 0
    frame = mbs.models.transform(system, 6)
    for solution in answer:
        assert np.max(np.abs(np.array(frame(solution.q)) - T)) < 1e-12
        assert solution.residual < 1e-12


def test_a_parallel_robot():
    system = assembled("delta")
    T = np.array(mbs.models.transform(system, "tool")(np.array(system.configuration)))
    answer = solve(system, T, "tool")
    assert len(answer) == 8
    assert max(s.residual for s in answer) < 1e-12
    assert min(s.sigma_min for s in answer) > 1e-3


def test_wrong_arguments_are_named():
    system, T = assembled("puma560"), np.eye(4)
    with pytest.raises(ModelError, match=r"method is 'piper'.*did you mean 'pieper'"):
        solve(system, T, method="piper")
    with pytest.raises(ModelError, match="hand"):
        solve(system, T, "hand")
    with pytest.raises(ModelError, match="general method does not hold"):
        solve(assembled("scara"), T, method="general")
    with pytest.raises(ModelError, match="5 values"):
        solve(system, T, seed=[0.0] * 5)
    for locked in (["q6"], "q6"):
        with pytest.raises(ModelError, match=r"locked is .*give a dict of joint names"):
            solve(system, T, locked=locked)
    with pytest.raises(ModelError, match=r"the parameters are .*give a dict of names"):
        solve(system, T, parameters=np.array([1.0, 2.0]))
    T[0, 0] = np.nan
    with pytest.raises(ModelError, match="row"):
        solve(system, T)


def test_the_table():
    q = [0.3, -0.5, 0.7, 0.4, 0.0, 0.2]
    text = str(solve(assembled("puma560"), pose("puma560", q)))
    lines = text.splitlines()
    assert lines[0] == "puma560: 7 solutions by pieper"
    assert lines[1].split()[:6] == ["q1", "q2", "q3", "q4", "q5", "q6"]
    assert len(lines) == 9
    assert "any q4 with q4 + q6 = 0.6" in text
    far = np.eye(4)
    far[0, 3] = 9.0
    assert "no solution. out of reach" in str(solve(assembled("puma560"), far))


@pytest.mark.parametrize(("q5", "count", "families"), [(1e-5, 8, 0), (1e-8, 8, 0), (1e-13, 7, 1)])
def test_next_to_two_singularities(q5, count, families):
    """The elbow nearly straight too: rounding alone must not make copies or self-motions."""
    q = [0.6109, 2.4448, -1.4235, -1.6989, q5, -2.2803]
    T = pose("puma560", q)
    answer = solve(assembled("puma560"), T)
    assert len(answer) == count
    assert sum(s.family is not None for s in answer) == families
    assert max(s.residual for s in answer) < 1e-12
    near = nearest_of(assembled("puma560"), answer, q)
    assert near < 1e-5 or any(s.family.contains(np.array(q)) for s in answer if s.family)


def test_a_locked_joint_keeps_its_value_whatever_the_seed():
    system = assembled("puma560")
    q = np.array([0.3, -0.5, 0.7, 0.4, 0.9, 0.2])
    T = pose("puma560", q)
    answer = solve(system, T, locked={"q6": 0.2}, seed=np.zeros(6))
    assert len(answer) >= 1
    assert np.all(answer.q[:, 5] == 0.2)
    assert nearest_of(system, answer, q) < 1e-9


@pytest.mark.parametrize("name", ["puma560", "ur5", "crx10"])
@pytest.mark.parametrize("asked", [{}, {"limits": True}, {"seed": [0.3, 2.0, -5.0, 9.0, 0.1, 1.0]}])
def test_a_regular_pose_takes_a_short_way_to_the_same(name, asked):
    system = catalogue_system(name)
    arm = frame_chain(system).arm(np.zeros(0))
    for q in np.random.default_rng(7).uniform(-2, 2, (8, 6)):
        T = target_pose(system, arm.pose(q))
        short = solve(system, T, **asked)
        long = solve_rigid(system, T, None, "auto", **asked, locked=None, parameters=None)
        assert len(short) == len(long)
        assert short.method == long.method
        np.testing.assert_allclose(short.q, long.q, rtol=0, atol=1e-12)
        for one, other in zip(short, long, strict=True):
            assert (one.branch, one.multiplicity) == (other.branch, other.multiplicity)
            assert one.within_limits == other.within_limits == (len(one.windings) > 0)
            np.testing.assert_allclose(one.windings, other.windings, rtol=0, atol=1e-12)
            assert one.sigma_min == pytest.approx(other.sigma_min, rel=1e-9)
            assert max(one.residual, other.residual) < 1e-12


def test_solutions_are_a_sequence_that_is_pickled():
    system = catalogue_system("puma560")
    T = frame_chain(system).arm(np.zeros(0)).pose(np.array([0.3, -0.5, 0.7, 0.4, 0.9, 0.2]))
    found = solve(system, T)
    assert found[-1] is found[7]
    assert [s.branch for s in found[2:5]] == [found[k].branch for k in (2, 3, 4)]
    with pytest.raises(IndexError):
        found[8]
    again = pickle.loads(pickle.dumps(found))
    assert np.array_equal(again.q, found.q)
    assert np.array_equal(again[1].windings, found[1].windings)
    found.q[:] = 0.0  # a copy
    assert np.array_equal(again.q, found.q)
