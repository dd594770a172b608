"""Placements: what rotations a user may write, and what they mean."""

import numpy as np
import pytest
from casadi import DM, SX
from support.messages import refused
from support.random_trees import random_rotation

from mbs.components import Body
from mbs.components.component import ElementaryRotation, FixedRotation, KhalilStep, Translation
from mbs.errors import DescriptionError

B = Body("b", mass=0)


def matrix(point, **values):
    return DM(point.placement.pose({name: SX(v) for name, v in values.items()}).matrix).full()


def turn(axis, angle):
    c, s = np.cos(angle), np.sin(angle)
    k, h = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    R = np.eye(3)
    R[k, k], R[k, h], R[h, k], R[h, h] = c, -s, s, c
    return R


def test_position():
    T = matrix(B.at("L", 2, -3), L=0.5)
    assert T[:3, 3].tolist() == [0.5, 2, -3]
    assert T[:3, :3].tolist() == np.eye(3).tolist()
    assert B.at().placement.steps == ()
    assert [type(s) for s in B.at(1, rotation=("z", 2)).placement.steps] == [
        Translation,
        ElementaryRotation,
    ]


@pytest.mark.parametrize("axis", "xyz")
def test_one_turn(axis):
    np.testing.assert_allclose(
        matrix(B.at(rotation=(axis, 0.3)))[:3, :3], turn(axis, 0.3), atol=1e-15
    )
    np.testing.assert_allclose(
        matrix(B.at(rotation=[axis, "pi/2 + A"]), A=0.2)[:3, :3],
        turn(axis, np.pi / 2 + 0.2),
        atol=1e-15,
    )


def test_turns_follow_each_other_in_the_turned_frame():
    rotation = [("z", 0.3), ("x", -0.7), ("y", 1.1)]
    wanted = turn("z", 0.3) @ turn("x", -0.7) @ turn("y", 1.1)
    np.testing.assert_allclose(matrix(B.at(rotation=rotation))[:3, :3], wanted, atol=1e-15)
    np.testing.assert_allclose(
        matrix(B.at(rotation=rotation[:2]))[:3, :3], wanted @ turn("y", -1.1), atol=1e-15
    )
    np.testing.assert_allclose(matrix(B.at(rotation=tuple(rotation)))[:3, :3], wanted, atol=1e-15)


def test_matrix():
    R = random_rotation(np.random.default_rng(0))
    for given in (R, R.tolist(), tuple(map(tuple, R))):
        np.testing.assert_allclose(matrix(B.at(rotation=given))[:3, :3], R, atol=1e-15)
    assert isinstance(B.at(rotation=np.eye(3)).placement.steps[0], FixedRotation)


def test_matrix_with_few_digits_is_put_right():
    R = random_rotation(np.random.default_rng(0))
    made = matrix(B.at(rotation=R.round(7)))[:3, :3]
    np.testing.assert_allclose(made, R, atol=1e-7)
    np.testing.assert_allclose(made.T @ made, np.eye(3), atol=1e-15)
    quarter = matrix(B.at(rotation=[[0, -1, 1e-14], [1, 0, 0], [0, 0, 1]]))[:3, :3]
    assert set(np.unique(quarter)) == {-1.0, 0.0, 1.0}


def test_chains():
    point = B.at(1, rotation=("z", np.pi / 2)).at(2).at_khalil(d=0.5, alpha="pi/2")
    T = matrix(point)
    np.testing.assert_allclose(T[:3, 3], [1, 2.5, 0], atol=1e-15)
    assert T[:3, 2].tolist() == [1, 0, 0]  # x turned by z, then z turned by alpha about it
    assert isinstance(point.placement.steps[-1], KhalilStep)


@pytest.mark.parametrize(
    ("rotation", "parts"),
    [
        (("w", 1), ["rotation axis 'w' is not 'x', 'y' or 'z'", "use one"]),
        ([("z", 1), ("zx", 1)], ["rotation axis 'zx'", "use one"]),
        (("z", 1, 2), ["rotation ('z', 1, 2) is not a rotation", "give ('z', angle)"]),
        ("z", ["rotation 'z' is not a rotation", "give ('z', angle)"]),
        ("xy", ["rotation 'xy' is not a rotation", "give ('z', angle)"]),
        (1.57, ["rotation 1.57 is not a rotation", "give ('z', angle)"]),
        (np.eye(2), ["is not a rotation", "orthonormal right-handed (3, 3) matrix"]),
        (-np.eye(3), ["is not a rotation", "right-handed"]),
        (2 * np.eye(3), ["is not a rotation", "orthonormal"]),
        (np.eye(3) * np.nan, ["is not a rotation", "orthonormal"]),
        ([["a", "b", "c"]] * 3, ["is not a rotation"]),
        (("z", None), ["rotation about z: None is not a finite number"]),
        (("z", "1+"), ["rotation about z: cannot read '1+'"]),
    ],
    ids=str,
)
def test_refused_rotations(rotation, parts):
    refused(DescriptionError, "b.at", *parts, by=lambda: B.at(rotation=rotation))


def test_refused_positions():
    refused(DescriptionError, "b.at, y: cannot read '1+'", by=lambda: B.at(0, "1+"))
    refused(DescriptionError, "b.at_khalil, d: None is not", by=lambda: B.at_khalil(d=None))
