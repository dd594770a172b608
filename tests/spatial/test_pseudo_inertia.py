"""Second moments of bodies against clouds of point masses, in numpy."""

import casadi
import numpy as np
import pytest
from casadi import DM, SX
from support.random_trees import random_rotation

from mbs.spatial import Inertia, MatrixRotation, PseudoInertia, axis_rotation, is_zero


def numeric(value):
    return DM(value).full().squeeze()


def cloud(seed, n=6):
    rng = np.random.default_rng(seed)
    return rng.uniform(0.1, 2, n), rng.uniform(-1, 1, (n, 3))


def moments(masses, points):
    """(4, 4): the integral of [r; 1] [r; 1]' dm."""
    ones = np.column_stack([points, np.ones(len(points))])
    return (masses[:, None, None] * ones[:, :, None] * ones[:, None, :]).sum(0)


def body_of(masses, points):
    P = moments(masses, points)
    return PseudoInertia(SX(DM(P[:3, :3])), SX(DM(P[:3, 3])), SX(P[3, 3]))


def written(body):
    """(4, 4) of a body."""
    ms = numeric(body.ms)[:, None]
    return np.block([[numeric(body.S), ms], [ms.T, float(body.m)]])


def tensor(P):
    return np.trace(P[:3, :3]) * np.eye(3) - P[:3, :3]


@pytest.mark.parametrize("seed", range(3))
def test_from_the_inertia_tensor(seed):
    P = moments(*cloud(seed))
    inertia = Inertia(SX(DM(tensor(P))), SX(DM(P[:3, 3])), SX(P[3, 3]))
    np.testing.assert_allclose(written(PseudoInertia.of(inertia)), P, atol=1e-14)


@pytest.mark.parametrize("seed", range(3))
def test_to_the_inertia_tensor(seed):
    P = moments(*cloud(seed))
    inertia = body_of(*cloud(seed)).inertia()
    np.testing.assert_allclose(numeric(inertia.J), tensor(P), atol=1e-14)
    np.testing.assert_allclose(numeric(inertia.ms), P[:3, 3], atol=1e-14)
    assert float(inertia.m) == pytest.approx(P[3, 3])


def test_a_flat_body_has_exact_zeros():
    made = PseudoInertia.of(Inertia(SX(DM(np.diag([0.1, 0.2, 0.3]))), SX.zeros(3), SX(1)))
    assert made.S[2, 2].is_zero()
    np.testing.assert_allclose(np.diag(numeric(made.S)), [0.2, 0.1, 0], atol=1e-16)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("t", [0.0, 0.6, -1.5])
def test_slid(axis, t):
    masses, points = cloud(4)
    moved = points + t * np.eye(3)[axis]
    np.testing.assert_allclose(
        written(body_of(masses, points).shift(axis, SX(t))), moments(masses, moved), atol=1e-14
    )


@pytest.mark.parametrize("axis", range(3))
def test_slid_by_a_symbol(axis):
    masses, points = cloud(5)
    t = SX.sym("t")
    body = body_of(masses, points).shift(axis, t)
    f = casadi.Function("f", [t], [body.S, body.ms, body.m])
    S, ms, m = (DM(x).full().squeeze() for x in f(0.35))
    P = moments(masses, points + 0.35 * np.eye(3)[axis])
    np.testing.assert_allclose(S, P[:3, :3], atol=1e-14)
    np.testing.assert_allclose([*ms, m], P[:, 3], atol=1e-14)


@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("angle", [0.8, np.pi / 2, np.pi, -np.pi / 2])
def test_turned_about_an_axis(axis, angle):
    masses, points = cloud(6)
    turn = axis_rotation(axis, SX(angle))
    got = written(body_of(masses, points).rotate(turn))
    np.testing.assert_allclose(got, moments(masses, points @ numeric(turn.matrix).T), atol=1e-14)


def test_turned_by_a_matrix():
    masses, points = cloud(7)
    R = random_rotation(np.random.default_rng(1))
    got = written(body_of(masses, points).rotate(MatrixRotation(SX(DM(R)))))
    np.testing.assert_allclose(got, moments(masses, points @ R.T), atol=1e-14)


def test_sum():
    masses, points = cloud(8)
    whole = body_of(masses[:2], points[:2]) + body_of(masses[2:], points[2:])
    np.testing.assert_allclose(written(whole), moments(masses, points), atol=1e-14)


@pytest.mark.parametrize("split", ["along_axis", "rotational", "massive"])
@pytest.mark.parametrize("form", [PseudoInertia, Inertia])
def test_parts_make_the_whole(split, form):
    P = moments(*cloud(9))
    square = P[:3, :3] if form is PseudoInertia else tensor(P)
    body = form(SX(DM(square)), SX(DM(P[:3, 3])), SX(P[3, 3]))
    one, other = getattr(body, split)()
    whole = one + other
    for got, expected in (
        (whole.S if form is PseudoInertia else whole.J, square),
        (whole.ms, P[:3, 3]),
        (whole.m, P[3, 3]),
    ):
        np.testing.assert_allclose(numeric(got), expected, atol=1e-14)


@pytest.mark.parametrize("form", [PseudoInertia, Inertia])
def test_what_each_part_holds(form):
    P = moments(*cloud(10))
    square = P[:3, :3] if form is PseudoInertia else tensor(P)
    body = form(SX(DM(square)), SX(DM(P[:3, 3])), SX(P[3, 3]))

    def of(part):
        return part.S if form is PseudoInertia else part.J

    felt, on_axis = body.along_axis()
    k = 2 if form is PseudoInertia else 1
    assert of(felt)[k, k].is_zero()
    assert felt.ms[2].is_zero()
    assert felt.m.is_zero()
    quarter = axis_rotation("z", SX(0.9))
    np.testing.assert_allclose(
        numeric(of(on_axis.rotate(quarter))), numeric(of(on_axis)), atol=1e-15
    )
    assert is_zero(on_axis.ms[:2])
    rest, turning = body.rotational()
    assert is_zero(of(rest))
    assert is_zero(turning.ms)
    assert turning.m.is_zero()
    light, heavy = body.massive()
    assert light.m.is_zero()
    assert is_zero(of(heavy))
    assert is_zero(heavy.ms)
