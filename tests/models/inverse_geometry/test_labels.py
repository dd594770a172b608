"""Names of branches: shoulder, elbow and wrist where an arm has them."""

import math
from functools import cache

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.models.inverse_geometry import solve
from mbs.models.inverse_geometry.branches import BranchLabels, anatomy, labels
from mbs.models.inverse_geometry.chain import frame_chain


@cache
def arm(name):
    return frame_chain(catalogue_system(name)).arm(np.zeros(0))


def label(name, q):
    return labels(arm(name), anatomy(arm(name)), np.array([q], dtype=float))[0]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("puma560", BranchLabels(shoulder=True, elbow=True, wrist=True)),
        ("rx90", BranchLabels(shoulder=True, elbow=True, wrist=True)),
        ("stanford", BranchLabels(shoulder=True, elbow=False, wrist=True)),
        ("scara", BranchLabels(shoulder=False, elbow=False, wrist=False)),
    ],
)
def test_anatomy(name, expected):
    assert anatomy(arm(name)) == expected


@pytest.mark.parametrize("name", ["puma560", "rx90"])
def test_eight_branches_have_eight_names(name):
    system = catalogue_system(name)
    T = np.array(mbs.models.direct_geometry(system)([0.3, -0.5, 0.7, 0.4, 0.9, 0.2]))
    names = {s.branch for s in solve(system, T)}
    assert names == {
        f"shoulder {shoulder}, elbow {elbow}, {wrist}"
        for shoulder in ("left", "right")
        for elbow in ("up", "down")
        for wrist in ("flip", "no flip")
    }


def test_right_is_where_a_positive_joint_2_lifts_the_wrist():
    q, step = np.array([0.3, -0.5, 0.7, 0.4, 0.9, 0.2]), np.array([0, 1e-6, 0, 0, 0, 0])
    wrist = mbs.models.transform(catalogue_system("puma560"), 4)
    for turn in (0.0, 1.2, 2.4, -2.0):
        configuration = q + turn * np.eye(6)[1]
        height = [float(wrist(configuration + way)[2, 3]) for way in (step, -step)]
        assert label("puma560", configuration).startswith(
            "shoulder right" if height[0] > height[1] else "shoulder left"
        )


def test_up_is_where_the_elbow_is_above_the_line_to_the_wrist():
    system = catalogue_system("puma560")
    elbow, wrist = mbs.models.transform(system, 3), mbs.models.transform(system, 4)
    rng = np.random.default_rng(5)
    shoulder = mbs.models.transform(system, 2)
    for q in rng.uniform(-3, 3, (20, 6)):
        at_elbow, at_wrist = (np.array(f(q))[:3, 3] for f in (elbow, wrist))
        frame = np.array(shoulder(q))
        axis, origin = frame[:3, 2], frame[:3, 3]
        flat = [p - origin - axis * (axis @ (p - origin)) for p in (at_elbow, at_wrist)]
        above = flat[0] - flat[1] * (flat[0] @ flat[1]) / (flat[1] @ flat[1])
        assert ("elbow up" in label("puma560", q)) == (above[2] > 0)


def test_names_are_left_out_between_two_branches():
    assert label("puma560", [0.3, -0.5, 0.7, 0.4, 0.0, 0.2]) == "shoulder left, elbow down"
    name = label("puma560", [0.3, -0.5, _straight(1.0), 0.4, 0.9, 0.2])
    assert name.split(", ")[1:] == ["elbow straight", "no flip"]


def _straight(q3):
    """The angle next to q3 at which the two parts of the arm lie along one line."""
    system = catalogue_system("puma560")
    wrist = np.array(mbs.models.transform(system, 4, 2)([0, 0, q3, 0, 0, 0]))[:2, 3]
    elbow = np.array(mbs.models.transform(system, 3, 2)(np.zeros(6)))[:2, 3]
    fore = wrist - elbow
    return q3 - math.atan2(elbow[0] * fore[1] - elbow[1] * fore[0], elbow @ fore)


def test_the_general_arm_has_none():
    assert label("scara", [0.1, 0.2, 0.3, 0.0]) == ""
