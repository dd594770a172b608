"""The chain to a frame: which joints are solved for, and what is refused."""

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.errors import ModelError
from mbs.models.inverse_geometry import solve_many
from mbs.models.inverse_geometry.chain import frame_chain


@pytest.fixture(scope="module")
def puma():
    return catalogue_system("puma560")


def test_it_is_kept_on_the_system(puma):
    way = frame_chain(puma, locked={"q6": 0.3, "q4": 0.1})
    assert frame_chain(puma, 6, {"q4": 0.1, "q6": 0.3}) is way
    assert frame_chain(puma, 6, {"q4": 0.1, "q6": 0.4}) is not way
    assert (way.names, way.indices) == (("q1", "q2", "q3", "q5"), (0, 1, 2, 4))
    assert way.locked == {"q4": 0.1, "q6": 0.3}
    p = np.zeros(0)
    assert way.arm(p) is way.arm(p)


def test_locked_joints_stand_in_its_ways(puma):
    q = np.array([0.3, -0.8, 0.4, 0.2, 0.6, 0.1])
    way = frame_chain(puma, locked={"q2": q[1], "q6": q[5]})
    expected = np.array(mbs.models.direct_geometry(puma)(q))
    assert way.arm(np.zeros(0)).pose(q[list(way.indices)]) == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize(
    ("frame", "locked", "message"),
    [
        (6, "q1", "locked is 'q1'; give a dict"),
        (6, {"q9": 0.0}, "joint 'q9' is not between the base and the frame"),
        (3, {"q5": 0.0}, "joint 'q5' is not between the base and the frame"),
        (2, {"q1": 0.1, "q2": 0.2}, "every joint between the base and frame 2 is locked; leave"),
        (0, None, "no joint moves frame 0"),
    ],
)
def test_refusals(puma, frame, locked, message):
    with pytest.raises(ModelError, match=message):
        frame_chain(puma, frame, locked)


def test_the_elbow_is_not_proposed_to_be_locked():
    with pytest.raises(ModelError, match=r"7 joints are free .* locked=\{'q3': 0\}"):
        frame_chain(catalogue_system("panda"))


def test_many_poses_need_a_system():
    with pytest.raises(ModelError, match="is not a System"):
        solve_many("puma560", [np.eye(4)])
