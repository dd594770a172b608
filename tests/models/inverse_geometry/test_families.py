"""Self-motions: which joints move, how they are related, and the configurations along them."""

import math
from functools import cache

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.errors import ModelError
from mbs.models.inverse_geometry import solve


@cache
def assembled(name):
    return catalogue_system(name)


def pose(system, q):
    return np.array(mbs.models.direct_geometry(system)(q))


def only_family(answer):
    families = [s.family for s in answer if s.family is not None]
    assert len(families) == 1
    return families[0]


def test_a_wrist_singularity():
    system, q = assembled("puma560"), np.array([0.3, -0.5, 0.7, 0.4, 0.0, 0.2])
    T = pose(system, q)
    answer = solve(system, T)
    family = only_family(answer)
    assert (family.free, family.moving, family.range) == ("q4", ("q4", "q6"), None)
    assert family.relations == ("q4 + q6 = 0.6",)
    assert family.dimension == 1
    assert str(family) == "any q4 with q4 + q6 = 0.6"
    for value in (-2.5, 0.0, 1.3, 3.1):
        at = family.at(value)
        assert at[3] == value
        assert np.max(np.abs(pose(system, at) - T)) < 1e-12
        assert family.contains(at)
    assert not family.contains(q + 1e-4 * np.eye(6)[3])
    assert np.max(np.abs(pose(system, family.samples[5]) - T)) < 1e-12
    assert answer[0].multiplicity == 0


def test_the_configuration_that_stands_for_it():
    """Zero of the free joint, its seed, or the next place within limits."""
    system, q = assembled("puma560"), np.array([0.3, -0.5, 0.7, 0.4, 0.0, 0.2])
    T = pose(system, q)

    def shown(**options):
        return next(s.q for s in solve(system, T, **options) if s.family)

    assert shown()[3] == 0.0
    assert shown(seed=q)[3] == pytest.approx(0.4, abs=1e-12)
    assert shown(seed=q) == pytest.approx(q, abs=1e-9)
    within = shown(limits={"q4": (0.5, 1.0)})
    assert 0.5 <= within[3] <= 1.0
    assert within[3] + within[5] == pytest.approx(0.6, abs=1e-9)


def test_a_shoulder_singularity_turns_all_the_way_round():
    """The wrist centre on axis 1 of an arm without offset: joint 1 turns, the wrist follows."""
    system = assembled("rx90")
    wrist = mbs.models.transform(system, 5)

    def reach(q2):
        return float(wrist([0.0, q2, 0.9, 0, 0, 0])[0, 3])

    middle = 0.5 * (reach(0) + reach(math.pi))
    c, s = reach(0) - middle, reach(math.pi / 2) - middle
    q2 = math.atan2(s, c) + math.acos(-middle / math.hypot(c, s))
    q = np.array([0.4, q2, 0.9, 0.3, 0.7, -0.2])
    T = pose(system, q)
    families = [solution.family for solution in solve(system, T)]
    assert len(families) == 4  # two elbows, flipped or not
    assert all(family.free == "q1" and family.range is None for family in families)
    # once, not on from one to the other: flipped and not they pass at 6e-4
    turned = [abs(family.samples[-1] - family.samples[0])[0] for family in families]
    assert turned == pytest.approx([2 * math.pi] * 4)
    own = next(family for family in families if family.contains(q))
    assert own.relations == ()
    for sample in own.samples[::7]:
        assert np.max(np.abs(pose(system, sample) - T)) < 1e-12
        assert own.contains(sample)


def planar(count, **values):
    rows = [
        {"antecedent": k, "joint": "revolute", "d": 0.0 if k == 0 else 0.4, **values}
        for k in range(count)
    ]
    return mbs.load({"name": "planar", "frame": rows}).assemble()


def test_one_joint_more_than_the_plane_needs():
    """Four turns in a plane: the curve of a four-bar whose free joint does not go all round."""
    system, q = planar(4), np.array([0.3, 0.9, -0.5, 0.4])
    T = pose(system, q)
    family = next(s.family for s in solve(system, T) if s.family.contains(q))
    assert len(family.moving) == 4
    for sample in family.samples:
        assert np.max(np.abs(pose(system, sample) - T)) < 1e-12
    low, high = family.range
    place = int(family.free[1:]) - 1
    assert low <= min(family.samples[:, place]) < low + 0.01
    assert high >= max(family.samples[:, place]) > high - 0.01
    for value in (low + 1e-9, high - 1e-9):
        assert np.max(np.abs(pose(system, family.at(value)) - T)) < 1e-12
    for value in (low - 1e-6, high + 1e-6):
        with pytest.raises(ModelError, match="moves between"):
            family.at(value)


def test_two_slides_along_one_line():
    rows = [
        {"antecedent": 0, "joint": "prismatic"},
        {"antecedent": 1, "joint": "prismatic"},
        {"antecedent": 2, "joint": "revolute", "d": 0.3},
    ]
    system = mbs.load({"name": "lift", "frame": rows}).assemble()
    q = np.array([0.2, 0.3, 0.4])
    family = only_family(solve(system, pose(system, q)))
    assert family.relations == ("q1 + q2 = 0.5",)
    assert family.range is None
    assert family.at(5.0) == pytest.approx([5.0, -4.5, 0.4], abs=1e-12)


def test_two_freedoms():
    """Five turns in a plane: one family of dimension two, however many configurations are met."""
    system, q = planar(5), np.array([0.3, 0.9, -0.5, 0.4, 0.2])
    answer = solve(system, pose(system, q))
    assert {s.family.dimension for s in answer} == {2}
    assert len(answer) <= 2
