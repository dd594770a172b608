"""More joints than a pose determines: each position of the redundant ones is as if locked there."""

import numpy as np
import pytest
from support.arm_search import distance, plain_arm
from support.catalogue_systems import catalogue_system
from support.sweeps import slow

import mbs
from mbs.errors import ModelError
from mbs.models.inverse_geometry import solve

solve_many = mbs.models.inverse_geometry.solve_many


@pytest.fixture(scope="module")
def panda():
    return catalogue_system("panda")


def poses(system, count, seed=1):
    rng = np.random.default_rng(seed)
    low, high = (np.array([c.limits[k] for c in system.coordinates]) for k in (0, 1))
    q = rng.uniform(low, high, (count, system.nq))
    dgm = mbs.models.direct_geometry(system)
    return q, np.array([np.array(dgm(x)) for x in q])


def residual(system, T, q):
    """By the forward model of the whole arm, with all seven joints."""
    return np.abs(plain_arm(system, None).pose(q) - T).max(axis=(-2, -1))


@pytest.mark.parametrize(("joint", "count"), [slow("q7", 16), ("q4", 7), ("q3", 5)])
def test_every_sample_is_as_locked(panda, joint, count):
    """By a closed form (q7, q4), whose equations hold the joint as a symbol, and without (q3)."""
    own, T = poses(panda, 2)
    index = [c.name for c in panda.coordinates].index(joint)
    values, asked = np.linspace(*panda.coordinates[index].limits, count), count
    if joint == "q4":  # the distance between shoulder and wrist leaves it little room
        values = asked = own[0, 3] + np.linspace(-0.1, 0.1, count)
    many = solve_many(panda, T, redundant={joint: asked})
    columns = len(many.labels) // count
    assert many.samples == count
    assert many.q.shape == (2, count * columns, 7)
    q, valid = many.q.reshape(2, count, columns, 7), many.valid.reshape(2, count, columns)
    found = 0
    for k in range(2):
        for s, value in enumerate(values):
            ours = q[k, s, valid[k, s]]
            assert np.all(ours[:, index] == value)
            theirs = solve(panda, T[k], locked={joint: value})
            assert len(ours) == len(theirs)
            found += len(ours)
            if len(ours):
                assert residual(panda, T[k], ours).max() < 1e-12
                apart = distance(plain_arm(panda, None), ours[:, None], theirs.q[None])
                assert np.max(np.min(apart, axis=1)) < 1e-8
                assert np.max(np.min(apart, axis=0)) < 1e-8
    assert found >= 8


def test_machine_code_gives_the_same(panda):
    """From a thousand samples on, those of earlier calls included."""
    panda = mbs.load("panda").assemble()
    _, T = poses(panda, 1, 2)
    few = solve_many(panda, T, redundant={"q7": 40})
    for _ in range(30):
        many = solve_many(panda, T, redundant={"q7": 40})
    assert np.array_equal(few.valid, many.valid)
    assert np.max(np.abs(few.q - many.q)[few.valid]) < 1e-10


def test_positions_are_given_as_they_are_wanted(panda):
    q, T = poses(panda, 3, 3)
    own = solve_many(panda, T, locked={"q7": q[:, 6]})
    assert own.samples == 1
    for k in range(3):
        apart = distance(plain_arm(panda, None), own.of(k), q[k])
        assert np.min(apart) < 1e-9
        assert np.all(own.of(k)[:, 6] == q[k, 6])
    same = solve_many(panda, T, redundant={"q7": q[:, 6:]})
    assert np.array_equal(own.q, same.q)
    for_all = solve_many(panda, T, redundant={"q7": [0.1, 0.9]})
    for_each = solve_many(panda, T, redundant={"q7": np.tile([0.1, 0.9], (3, 1))})
    assert np.array_equal(for_all.q, for_each.q)
    assert set(for_all.of(0)[:, 6]) <= {0.1, 0.9}
    alone = solve_many(panda, T[:1], redundant={"q7": 1})
    assert set(alone.q[..., 6].ravel()) == {0.0}


def test_limits_hold_for_the_redundant_joint_too(panda):
    _, T = poses(panda, 1, 4)
    free = solve_many(panda, T, redundant={"q7": [0.3, 3.5]})
    held = solve_many(panda, T, redundant={"q7": [0.3, 3.5]}, limits={"q7": (-1, 1)})
    assert set(held.of(0)[:, 6]) <= {0.3}
    assert held.count[0] <= free.count[0]
    narrow = solve_many(panda, T, redundant={"q7": 3}, limits={"q7": (-1, 1)})
    assert set(narrow.q[..., 6].ravel()) == {-1.0, 0.0, 1.0}


def test_eight_joints_take_all_combinations():
    m = mbs.Mechanism("rail_and_arm", gravity=(0, 0, 0))
    axes = ["y", "z", "y", "y", "z", "y", "z"]
    carriage = m.add(mbs.components.Body("carriage", mass=0))
    m.connect(m.world, mbs.components.Prismatic("rail", axis="x"), carriage)
    last = carriage
    for k, axis in enumerate(axes):
        body = m.add(mbs.components.Body(f"b{k}", mass=0))
        place = last.at(0, 0, 0.4 if k in (2, 4) else 0)
        m.connect(place, mbs.components.Revolute(f"a{k}", axis=axis), body)
        last = body
    m.add_frame("tool", last.at(0, 0, 0.1))
    system = m.assemble()
    q = np.array([0.2, 0.3, -0.5, 0.4, 1.1, -0.3, 0.6, 0.2])
    T = np.array(mbs.models.transform(system, "tool")(q))
    redundant = {"a2": [0.1, q[3]], "rail": [-0.1, q[0], 0.3]}
    many = solve_many(system, [T], "tool", redundant=redundant)
    grid = many.q.reshape(6, -1, 8)[:, 0][:, [3, 0]]
    assert grid.tolist() == [[a, b] for a in redundant["a2"] for b in redundant["rail"]]
    assert np.min(np.abs(many.of(0) - q).max(axis=1)) < 1e-9
    for one in many.of(0):
        assert np.abs(np.array(mbs.models.transform(system, "tool")(one)) - T).max() < 1e-12
    with pytest.raises(ModelError, match="no limits between which 4 positions lie"):
        solve_many(system, [T], "tool", redundant={"a2": 3, "rail": 4})


def test_solve_gives_the_solutions_of_all_samples(panda):
    q, T = poses(panda, 1, 5)
    seed = q[0]
    found = solve(panda, T[0], redundant={"q7": [seed[6], 0.5]}, seed=seed)
    assert np.abs(found[0].q - seed).max() < 1e-10
    locked = [solve(panda, T[0], locked={"q7": value}) for value in (seed[6], 0.5)]
    assert len(found) == sum(map(len, locked))
    assert max(solution.residual for solution in found) < 1e-12
    T[0, 0, 3] = 4.0
    none = solve(panda, T[0], redundant={"q7": 3})
    assert none.reason.startswith("none at 3 positions of redundant joints; at q7 = ")
    assert "m away" in none.reason
    assert none.nearest is not None


def test_singular_samples_are_solved_by_themselves(panda):
    """At q6 = 0 axes 5 and 7 are parallel."""
    q = np.array([0.2, 0.4, 0.3, -1.2, 0.5, 0.0, 0.7])
    T = np.array(mbs.models.direct_geometry(panda)(q))
    many = solve_many(panda, [T], redundant={"q7": [0.7, 0.2]})
    apart = distance(plain_arm(panda, None), many.of(0), q)
    assert np.min(apart) < 1e-6
    assert residual(panda, T, many.of(0)).max() < 1e-12
    counts = many.valid.reshape(2, -1).sum(axis=1)
    for value, count in zip((0.7, 0.2), counts, strict=True):
        assert count == len(solve(panda, T, locked={"q7": value}))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, r"locked=\{'q3': 0\}, or ask for many positions of them with redundant=\{'q3': 64\}"),
        ({"redundant": {"q7": 0}}, "0 redundant positions of 'q7'; give one at least"),
        ({"redundant": {"q7": 0.5}}, "how many .a whole number."),
        ({"redundant": {"q7": True}}, "redundant positions of 'q7' are True"),
        ({"redundant": {"q7": []}}, "redundant positions of 'q7' are"),
        ({"redundant": {"q7": [np.nan]}}, "redundant positions of 'q7' are"),
        ({"redundant": {"q7": np.zeros((3, 2))}}, r"shape \(3, 2\); give how many"),
        ({"redundant": {"q9": 4}}, "no joint 'q9' to be redundant"),
        ({"redundant": {"q9": [0.1]}}, "'q9' is not between the base and the frame"),
        ({"redundant": "q7"}, "redundant is 'q7'; give a dict"),
        ({"redundant": {"q7": 4}, "locked": {"q7": 0.1}}, "'q7' is both locked and redundant"),
        ({"redundant": {"q7": 10**12}}, "are more than 10000000 in all"),
        ({"locked": {"q7": [0.1, 0.2]}}, "give one number, or one for each of the 1 poses"),
    ],
)
def test_wrong_questions(panda, given, message):
    with pytest.raises(ModelError, match=message):
        solve_many(panda, np.eye(4)[None], **given)


def test_an_arm_of_six_joints_may_be_sampled_too():
    """Five free joints reach the pose at the one position where it was made."""
    system = catalogue_system("puma560")
    q = np.array([0.3, -0.8, 0.4, 0.2, 0.6, 0.1])
    T = np.array(mbs.models.direct_geometry(system)(q))
    many = solve_many(system, [T], redundant={"q6": [0.1, 0.4]})
    counts = many.valid.reshape(2, -1).sum(axis=1)
    assert counts[0] >= 1
    assert counts[1] == 0
    assert np.min(np.abs(many.of(0) - q).max(axis=1)) < 1e-9
