"""Lists of `solve_many`, `solver`, `function` next to singular poses are marked as by `solve`.

A pose is moved by 1, 10 and 100 units in the last place: its lists differ only if they are marked.
"""

import numpy as np
import pytest
from support.near_singular import KINDS, ROBOTS, at_distance, plain, robot, units_away

from mbs.models.inverse_geometry import draft_many, function, solve, solve_many, solver
from mbs.native import compiled

CASES = [(name, kind) for name in ROBOTS[:-1] for kind in KINDS] + [(ROBOTS[-1], "wrist")]
DISTANCES = (-9, -7)
ALL = range(-12, -1)
UNITS = (1, 10, 100)


def near(name, kind, seed, exponents=DISTANCES):
    """Poses (n, 4, 4, 4): of each distance one and the same moved by 1, 10 and 100 units."""
    rng = np.random.default_rng((5, seed))
    poses = []
    for exponent in exponents:
        T = plain(name).pose(at_distance(name, kind, seed, 10.0**exponent))
        poses.append([T, *(units_away(T, count, rng) for count in UNITS)])
    return np.array(poses)


def require_marked(counts, marked):
    """Counts (n, 4) of each pose and its neighbours are equal, or one of them is marked."""
    differ = np.any(counts != counts[:, :1], axis=1)
    assert not np.any(differ & ~np.any(marked, axis=1))


def check_solve_many(name, T):
    found = solve_many(robot(name), T.reshape(-1, 4, 4))
    shape = T.shape[:2]
    require_marked(found.count.reshape(shape), found.undecided.reshape(shape))
    alone = [solve(robot(name), one) for one in T[:, 0]]
    count, marked = found.count.reshape(shape)[:, 0], found.undecided.reshape(shape)[:, 0]
    assert marked.tolist() == [answer.undecided for answer in alone]
    assert count.tolist() == [len(answer) for answer in alone]


@pytest.mark.parametrize(("name", "kind"), CASES[::4])
def test_many_poses_are_marked_as_each_alone(name, kind):
    check_solve_many(name, near(name, kind, 0))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("name", "kind"), CASES)
def test_more_poses_are_marked_as_each_alone(name, kind, seed):
    check_solve_many(name, near(name, kind, seed, ALL))


@pytest.mark.parametrize("name", ["puma560", "ur5", "general_6r"])
def test_without_a_compiler_and_by_machine_code_the_marks_are_the_same(name, monkeypatch):
    T = near(name, "wrist", 1).reshape(-1, 4, 4)
    one = solve_many(robot(name), T)
    monkeypatch.setattr(draft_many, "MANY", 1)
    machine = solve_many(robot(name), T)
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    interpreted = solve_many(robot(name), T)
    for other in (machine, interpreted):
        both = ~(one.undecided & other.undecided)
        assert (one.count == other.count)[both].all()
        assert (one.undecided == other.undecided).all()


def test_some_lists_are_marked_and_solver_has_the_mark():
    q = np.array([0.3, -0.9, 8e-7, 0.7, 0.8, 0.2])
    T = [plain("ur5").pose(q + away * np.eye(6)[2]) for away in (0.0, 0.5)]
    assert solve_many(robot("ur5"), T).undecided.tolist() == [True, False]
    assert [solver(robot("ur5"))(pose).undecided for pose in T] == [True, False]


def check_branches(name, kind, seed):
    """Branches of the function, compiled and not, differ only at poses that are not certain."""
    T = near(name, kind, seed, ALL)
    call = function(robot(name), branches="all")
    certain = call.certain(T.reshape(-1, 4, 4)).reshape(T.shape[:2])
    for f in (call, compiled(call, derivatives=0)):
        valid = np.array([[np.array(f(one)[1]).ravel() for one in row] for row in T])
        same = np.all(valid == valid[:, :1], axis=(1, 2))
        assert np.all(same | ~np.all(certain, axis=1))
    assert certain[-1].all()  # from a distance of 0.01 rad on
    return int(np.sum(~same))


def test_branches_of_a_function_differ_only_if_they_are_not_certain():
    assert check_branches("rx90", "shoulder", 0) >= 1
    assert check_branches("ur5", "wrist and elbow", 1) >= 1
    assert check_branches("puma560", "elbow and shoulder", 2) == 0
    call = function(robot("puma560"), branches="all")
    assert call.certain(plain("puma560").pose(np.array([0.3, -0.9, 0.4, 0.7, 0.8, 0.2]))) is True
    assert call.certain(plain("puma560").pose(np.array([0.3, -0.9, 0.4, 0.7, 0.0, 0.2]))) is False


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("name", "kind"), CASES[:-1])
def test_more_branches_differ_only_if_they_are_not_certain(name, kind, seed):
    check_branches(name, kind, seed)


def test_configurations_of_a_general_function_differ_only_if_they_are_not_certain():
    name = "general_6r"
    call = function(robot(name), branches="all")
    for seed in range(3):
        T = near(name, "wrist", seed, range(-12, -1))
        outputs = [[call(one) for one in row] for row in T]
        count, certain = (np.array([[float(o[k]) for o in row] for row in outputs]) for k in (2, 3))
        require_marked(count, certain == 0)
        listed = [[solve(robot(name), one) for one in row[:1]] for row in T]
        marked = np.array([answer.undecided for (answer,) in listed])
        assert not np.any(marked & (certain[:, 0] == 1))
        assert np.any(certain == 0)
        assert np.any(certain == 1)
