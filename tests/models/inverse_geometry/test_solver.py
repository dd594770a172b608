"""One pose after the other: the compiled call, the interpreter and numpy give the same."""

import pickle

import numpy as np
import pytest
from support.arm_search import distance, plain_arm, searched
from support.arms import general_6r, spherical
from support.catalogue_systems import catalogue_system

import mbs
from mbs.errors import ModelError, NoClosedForm
from mbs.models.inverse_geometry import PoseAnswer, PoseSolver, function, solve, solve_many, solver
from mbs.models.inverse_geometry.draft_compiled import kernel_of
from mbs.native import compiler_found

Q = np.array([0.3, -0.5, 0.7, 0.4, 0.9, 0.2])


def robot(name):
    made = {"general": lambda: general_6r(0), "quartic": lambda: spherical(3, 0)}
    return made[name]() if name in made else catalogue_system(name)


def posed(system, q=Q):
    arm = plain_arm(system)
    return arm, arm.pose(np.asarray(q)[: len(arm.slides)])


@pytest.mark.parametrize("name", ["puma560", "ur5", "stanford", "scara", "general", "quartic"])
def test_all_configurations_and_nothing_else(name):
    system = robot(name)
    solved = solver(system)
    arm = plain_arm(system)
    rng = np.random.default_rng(3)
    for q in rng.uniform(-2, 2, (20, len(arm.slides))):
        T = arm.pose(q)
        answer = solved(T)
        assert isinstance(answer, PoseAnswer)
        assert np.min(distance(arm, answer.q, q)) < 1e-9
        assert np.max(arm.residual(T, answer.q)) < 1e-12
        assert np.max(np.abs(answer.residual - arm.residual(T, answer.q))) < 2e-14
        assert np.all(np.abs(answer.q[:, ~arm.slides]) <= np.pi)
        apart = distance(arm, answer.q[:, None], answer.q[None]) + 9 * np.eye(len(answer))
        assert np.min(apart) > 1e-6
        assert len(set(answer.labels)) == len(answer)
    assert len(answer) == len(searched(arm, T))


@pytest.mark.parametrize("name", ["puma560", "ur5", "general"])
def test_without_a_compiler_the_answers_are_the_same(name, request):
    fresh = general_6r(0) if name == "general" else mbs.load(name).assemble()
    arm, T = posed(fresh)
    far = T.copy()
    far[:3, 3] += 9.0
    compiled = solver(robot(name))
    request.getfixturevalue("no_compiler")
    plain = solver(fresh)
    one, other = compiled(T), plain(T)
    order = np.argmin(distance(arm, one.q[:, None], other.q[None]), axis=1)
    assert sorted(order) == list(range(len(one))) == list(range(len(other)))
    assert np.max(distance(arm, one.q, other.q[order])) < 1e-12
    if name != "general":
        assert one.labels == other.labels
    assert len(plain(far)) == 0


@pytest.mark.parametrize("name", ["puma560", "general"])
def test_any_array_list_or_order_and_pickles(name):
    solved = solver(robot(name))
    _, T = posed(robot(name))
    expected = solved(T)
    again = pickle.loads(pickle.dumps(solved))
    assert isinstance(again, PoseSolver)
    wide = np.zeros((8, 8))
    wide[::2, ::2] = T
    for given in (
        T.tolist(),
        np.asfortranarray(T),
        T.T.copy().T,
        tuple(map(tuple, T)),
        wide[::2, ::2],
    ):
        assert np.array_equal(solved(given).q, expected.q)
        assert np.array_equal(again(given).q, expected.q)
    single = solved(T.astype(np.float32))
    assert len(single) == len(expected)
    assert np.max(np.abs(single.q - expected.q)) < 1e-4
    assert solved(T).labels == expected.labels


def test_labels_of_all_ways_are_one_set():
    rng = np.random.default_rng(7)
    for name in ("puma560", "rx90", "ur5"):
        system = catalogue_system(name)
        arm, igm, solved = plain_arm(system), function(system), solver(system)
        assert igm.labels == solved.labels
        T = arm.pose(rng.uniform(-2.5, 2.5, (12, 6)))
        many = solve_many(system, T)
        assert many.labels == solved.labels
        for k, pose in enumerate(T):
            answer = solved(pose)
            assert tuple(s.branch for s in solve(system, pose)) == answer.labels
            assert answer.labels == tuple(np.array(many.labels)[many.valid[k]])
            for q, label in zip(answer.q, answer.labels, strict=True):
                own, valid = igm(pose, igm.labels.index(label))
                assert valid
                assert np.max(np.abs(np.array(own).ravel() - q)) < 1e-9


def test_next_to_a_singular_configuration_it_says_so():
    system = catalogue_system("puma560")
    _, T = posed(system, [0.3, -0.5, 0.7, 0.4, 0.0, 0.2])
    answer = solver(system)(T)
    assert answer.singular
    families = [s.family for s in answer.solutions if s.family is not None]
    assert any(family.contains([0.3, -0.5, 0.7, 0.9, 0.0, -0.3]) for family in families)
    assert len(answer.labels) == len(answer)
    assert not solver(system)(posed(system)[1]).singular


def test_a_reason_where_there_is_none():
    system = catalogue_system("ur5")
    _, T = posed(system)
    T[:3, 3] += 5.0
    answer = solver(system)(T)
    T[:3, 3] -= 5.0
    assert len(answer) == 0
    assert answer.q.shape == (0, 6)
    assert answer.labels == ()
    assert "out of reach" in answer.reason
    assert answer.nearest.distance > 5
    reached = solver(system)(T)
    assert reached.reason == ""
    assert reached.nearest is None


def test_locked_joints_parameters_and_frames():
    panda = catalogue_system("panda")
    locked = {"q3": 0.4}
    arm = plain_arm(panda, locked)
    q = np.array([0.1, -0.4, -1.9, 0.3, 1.6, 0.5])
    answer = solver(panda, locked=locked)(arm.pose(q))
    assert np.all(answer.q[:, 2] == 0.4)
    assert np.min(distance(arm, np.delete(answer.q, 2, axis=1), q)) < 1e-9
    puma = catalogue_system("puma560")
    T = np.array(mbs.models.transform(puma, 3)(Q))
    assert T.shape == (4, 4)
    third = solver(puma, 3)(T)
    assert np.min(np.max(np.abs(third.q[:, :3] - Q[:3]), axis=1)) < 1e-9
    m = mbs.Mechanism("slide", gravity=(0, 0, 0))
    body, hand = (
        m.add(mbs.components.Body("arm", mass=0)),
        m.add(mbs.components.Body("hand", mass=0)),
    )
    m.connect(m.world, mbs.components.Revolute("q1", axis="z"), body)
    m.connect(body.at("L", 0, 0), mbs.components.Revolute("q2", axis="z"), hand)
    m.add_frame("tool", hand.at(0.5, 0, 0))
    system = m.assemble()
    T = np.array(mbs.models.direct_geometry(system)([0.3, 0.8], [0.7]))
    assert np.allclose(solver(system, parameters={"L": 0.7})(T).q, [[0.3, 0.8]])
    assert len(solver(system, parameters={"L": 0.5})(T)) == 0


def test_robots_with_loops_are_solved_as_solve_does():
    system = catalogue_system("five_bar")
    configuration = np.array(system.configuration)
    from mbs.models.geometry import terminal_frame

    T = np.array(mbs.models.transform(system, terminal_frame(system))(configuration))
    answer = solver(system)(T)
    assert len(answer) == len(solve(system, T))
    assert np.min(np.max(np.abs(answer.q - configuration), axis=1)) < 1e-9


def test_wrong_questions():
    system = catalogue_system("puma560")
    solved = solver(system)
    with pytest.raises(ModelError, match="has length 2"):
        solved(np.diag([1, 1, 2.0, 1]))
    with pytest.raises(ModelError, match="puma560: T is 'pose'"):
        solved("pose")
    with pytest.raises(ModelError, match="T\\[0, 3\\] is nan"):
        solved(np.array([[1, 0, 0, np.nan], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]))
    with pytest.raises(ModelError, match="last row"):
        solved(np.diag([1, 1, 1.0, 2]))
    with pytest.raises(ModelError, match="method is 'fast'"):
        solver(system, method="fast")
    with pytest.raises(NoClosedForm):
        solver(general_6r(0), method="paul")
    mirrored = np.diag([1, 1, -1.0, 1])
    with pytest.raises(ModelError, match="left-handed"):
        solved(mirrored)


def test_poses_are_rounded_as_everywhere():
    """To 1e-6 a transform counts as rigid, in C as in Python."""
    system = catalogue_system("puma560")
    solved = solver(system)
    _, T = posed(system)
    rough = T + 1e-7 * np.sin(np.arange(16)).reshape(4, 4) * (np.arange(4) < 3)[:, None]
    expected = solve(system, rough)
    assert np.max(np.abs(solved(rough).q - expected.q)) < 1e-12
    for skew in (2e-6, 1e-3):
        bad = T.copy()
        bad[0, 0] += skew
        with pytest.raises(ModelError):
            solved(bad)


@pytest.mark.skipif(not compiler_found(), reason="no C compiler")
@pytest.mark.parametrize("name", ["puma560", "ur5", "general"])
def test_the_compiled_call_and_arrays_give_the_same(name):
    """Row for row, on random poses and on those next to singular ones that stay certain."""
    system = robot(name)
    kernel = kernel_of(*_chain(system))
    code = kernel.code()
    assert code is not None
    arm = plain_arm(system)
    rng = np.random.default_rng(11)
    q = rng.uniform(-3, 3, (30, 6))
    q[:10, 4] = 10 ** rng.uniform(-3.5, -1, 10)
    for pose in arm.pose(q):
        one = kernel.draft(pose)
        other = kernel._by_arrays(pose)
        assert one.certain == other.certain
        assert len(one.q) == len(other.q)
        if name != "general":
            assert one.labels == other.labels
            assert np.max(distance(arm, one.q, other.q), initial=0) < 1e-9


def _chain(system):
    from mbs.models.inverse_geometry.chain import frame_chain

    return frame_chain(system), np.array(system.parameter_values(None))


def test_an_answer_keeps_its_pose():
    system = mbs.robots.ur5().assemble()
    T = np.array(mbs.models.transform(system, 6)([0.3, -0.8, 1.1, 0.4, 0.9, -0.2]))
    answer = solver(system)(T)
    T[:3, 3] = 0.0
    assert len(answer.solutions) == len(answer.q) == 8
