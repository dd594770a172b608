"""The number of roots that meet in a solution, where it is known beforehand."""

import math

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

from mbs.closed_forms.arm import Arm
from mbs.models.inverse_geometry.chain import frame_chain
from mbs.models.inverse_geometry.target import Target, multiplicity, reduction


def planar(*lengths):
    gaps = np.tile(np.eye(4), (len(lengths) + 1, 1, 1))
    gaps[1:, 0, 3] = lengths
    return Arm(tuple(f"q{k + 1}" for k in range(len(lengths))), np.zeros(len(lengths), bool), gaps)


def counted(arm, q):
    q = np.array(q, dtype=float)
    return multiplicity(reduction(Target(arm, arm.pose(q)), q))


def arm_of(name):
    return frame_chain(catalogue_system(name)).arm(np.zeros(0))


def test_a_regular_configuration_counts_once():
    assert counted(planar(0.5, 0.4, 0.3), [0.3, 0.8, -0.4])[0] == 1
    assert counted(arm_of("puma560"), [0.3, -0.5, 0.7, 0.4, 0.9, 0.2])[0] == 1


@pytest.mark.parametrize("q2", [0.0, math.pi])
def test_two_elbows_meet_in_a_straight_or_folded_arm(q2):
    q = [0.3, q2, -0.4]
    count, middle, _ = counted(planar(0.5, 0.4, 0.3), q)
    assert count == 2
    assert np.max(np.abs(middle - q)) < 1e-9


def test_an_inexact_double_root_is_moved_to_its_middle():
    arm, exact = planar(0.5, 0.4, 0.3), np.array([0.3, 0.0, -0.4])
    target = Target(arm, arm.pose(exact))
    null = reduction(target, exact).null[:, 0]
    count, middle, _ = multiplicity(reduction(target, exact + 2e-7 * null))
    assert count == 2
    assert np.max(np.abs(middle - exact)) < 1e-9
    assert target.residual(middle) < 1e-15


@pytest.mark.parametrize(("apart", "expected"), [(1e-5, 1), (1e-7, 2)])
def test_two_roots_are_one_where_they_are_closer_than_a_millionth(apart, expected):
    assert counted(planar(0.5, 0.4, 0.3), [0.3, apart / 2, -0.4])[0] == expected


@pytest.mark.parametrize("q5", [1e-5, 1e-7, 1e-9])
def test_next_to_a_wrist_singularity_roots_count_once(q5):
    assert counted(arm_of("puma560"), [0.3, -0.5, 0.7, 0.4, q5, 0.2])[0] == 1


class Polynomials(Target):
    """Equations whose roots at zero are known, in the place of those of an arm."""

    def excess(self, x):
        e, J = self.arm.polynomials(np.asarray(x, dtype=float))
        return e, J

    @property
    def unit(self):
        return np.ones(self.arm.size)

    @property
    def tolerance(self):
        return 1e-12

    def residual(self, q):
        return np.max(np.abs(self.excess(q)[0]), axis=-1)


class Equations:
    def __init__(self, size, polynomials):
        self.size, self.polynomials = size, polynomials


def power(k):
    """x1 + x2 = 0 and x2^k = 0 with x2 hidden by a turn of the unknowns."""

    def polynomials(x):
        a, b = x[..., 0], x[..., 1]
        t = 0.8 * a - 0.6 * b
        s = 0.6 * a + 0.8 * b + 0.3 * t**2
        zero = np.zeros_like(a)
        slope = k * t ** (k - 1)
        rows = [
            [0.6 + 0.48 * t, 0.8 - 0.36 * t],
            [0.8 * slope, -0.6 * slope],
        ]
        J = np.stack([np.stack(row, -1) for row in rows] + [np.zeros((*a.shape, 2))] * 4, -2)
        return np.stack([s, t**k, zero, zero, zero, zero], -1), J

    return Equations(2, polynomials)


@pytest.mark.parametrize("k", [1, 2, 3, 4])
def test_the_order_is_that_of_the_first_derivative(k):
    target = Polynomials(power(k), np.eye(4))
    assert multiplicity(reduction(target, np.zeros(2)))[0] == k


def conics(coefficients):
    """Two quadratic equations of two unknowns with a cubic term, and a third unknown."""

    def polynomials(x):
        a, b, c = x[..., 0], x[..., 1], x[..., 2]
        zero = np.zeros_like(a)
        rows, slopes = [c + a * b], [np.stack([b, a, zero + 1], -1)]
        for p, q, r, s in coefficients:
            rows.append(p * a**2 + q * a * b + r * b**2 + s * a**3)
            slopes.append(np.stack([2 * p * a + q * b + 3 * s * a**2, q * a + 2 * r * b, zero], -1))
        rows += [zero] * (6 - len(rows))
        slopes += [np.zeros((*a.shape, 3))] * (6 - len(slopes))
        return np.stack(rows, -1), np.stack(slopes, -2)

    return Equations(3, polynomials)


@pytest.mark.parametrize(
    ("coefficients", "expected"),
    [
        (((1, 0, 0, 0), (0, 0, 1, 0)), 4),
        (((1, 0.3, -1, 0.2), (0.5, 1, 0.4, -0.3)), 4),
        (((0, 1, 0, 0), (1, 0, -1, 0.7)), 4),
        (((0, 0, 1, 1), (0, 1, 0, 0)), 5),
        (((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0)), 3),
    ],
)
def test_two_null_directions(coefficients, expected):
    target = Polynomials(conics(coefficients), np.eye(4))
    assert multiplicity(reduction(target, np.zeros(3)))[0] == expected
