"""All real roots of quartics, each once, by two signs."""

from __future__ import annotations

import itertools

import casadi
import numpy as np
import pytest
from casadi import DM, SX

from mbs.closed_forms.sequence import real_quartic, trigonometric_quartic

SIGNS = tuple(itertools.product((1, -1), repeat=2))
APART = 1e-2


def roots_function(kernel, **scales):
    """a -> values, smallest radicands and regularity of the four choices, a column each."""
    a = SX.sym("a", 5)
    found = [kernel(a, SX(DM(choice)), **scales) for choice in SIGNS]
    rows = [casadi.horzcat(*(root.value for root in found))]
    rows.append(casadi.horzcat(*(casadi.mmin(root.real) for root in found)))
    rows.append(casadi.horzcat(*(root.regular for root in found)))
    return casadi.Function("roots", [a], [casadi.vertcat(*rows)])


TRIGONOMETRIC = roots_function(trigonometric_quartic)
REAL = roots_function(real_quartic)


def real_roots(function, a):
    value, real, _ = np.array(function(a))
    return np.sort(value[real >= 0])


def angles(a):
    """The roots of a trigonometric polynomial as those of a polynomial in e^(i t)."""
    c2, s2, c1, s1, c0 = a
    z = np.roots(
        [(c2 - 1j * s2) / 2, (c1 - 1j * s1) / 2, c0, (c1 + 1j * s1) / 2, (c2 + 1j * s2) / 2]
    )
    return np.sort(np.angle(z[np.abs(np.abs(z) - 1) < 1e-8])), z


def numbers(a):
    z = np.roots(a)
    return np.sort(z[np.abs(z.imag) < 1e-9].real), z


def well_separated(z):
    return min(abs(a - b) for a, b in itertools.combinations(z, 2)) > APART


def slope(a, t):
    c2, s2, c1, s1, _ = a
    return 2 * (s2 * np.cos(2 * t) - c2 * np.sin(2 * t)) + s1 * np.cos(t) - c1 * np.sin(t)


@pytest.mark.parametrize(
    "weights",
    [
        (1, 1, 1, 1, 1),
        (1, 1, 1, 1, 0.1),
        (1, 0, 1, 0, 0.3),
        (1, 0, 0, 1, 0.3),
        (1, 1, 0, 0, 0.5),
        (1e-3, 1e-3, 1, 1, 0.5),
        (1e-6, 1e3, 1e-6, 1, 1e3),
    ],
)
def test_every_real_angle_is_found_once(weights):
    rng, checked, most = np.random.default_rng(3), 0, 0
    for _ in range(150):
        a = rng.normal(size=5) * weights
        expected, z = angles(a)
        if not well_separated(z):
            continue
        checked, most = checked + 1, max(most, len(expected))
        found = real_roots(TRIGONOMETRIC, a)
        assert len(found) == len(expected)
        assert found == pytest.approx(expected, abs=1e-9)
    assert checked > 50
    assert most >= 2


@pytest.mark.parametrize("count", [0, 2, 4])
def test_every_real_number_is_found_once(count):
    rng, checked = np.random.default_rng(4), 0
    for _ in range(150):
        pairs = rng.normal(size=(4 - count) // 2) + 1j * rng.uniform(0.1, 2, (4 - count) // 2)
        z = np.concatenate([rng.normal(size=count) * 3, pairs, pairs.conj()])
        if not well_separated(z):
            continue
        checked += 1
        found = real_roots(REAL, rng.choice((-1, 1)) * rng.uniform(0.1, 5) * np.poly(z).real)
        assert len(found) == count
        assert found == pytest.approx(np.sort(z[:count].real), abs=1e-9)
    assert checked > 80


def test_quartics_of_even_powers():
    rng = np.random.default_rng(5)
    for _ in range(100):
        a = rng.normal(size=5) * (1, 0, 1, 0, 1)
        expected, z = numbers(a)
        if well_separated(z):
            assert real_roots(REAL, a) == pytest.approx(expected, abs=1e-9)


def test_vanishing_highest_powers_leave_the_finite_roots():
    value, real, regular = np.array(REAL([0, 0, 1, 0, -1]))
    assert np.sort(value[(real >= 0) & (regular > 1e-12)]) == pytest.approx([-1, 1])
    value, real, regular = np.array(REAL([0, 1, -6, 11, -6]))
    assert np.sort(value[(real >= 0) & (regular > 1e-12)]) == pytest.approx([1, 2, 3])


def test_the_scale_of_the_roots_does_not_matter():
    roots = np.array([-300.0, 40.0, 55.0, 900.0])
    scaled = roots_function(real_quartic, scale=250.0, unit=250.0**4)
    assert real_roots(scaled, np.poly(roots)) == pytest.approx(roots, rel=1e-10)


def test_the_second_sign_says_whether_the_polynomial_rises():
    rng, seen = np.random.default_rng(6), 0
    for _ in range(100):
        a = rng.normal(size=5) * (1, 1, 1, 1, 0.2)
        value, real, _ = np.array(TRIGONOMETRIC(a))
        rises = slope(a, value)
        for choice, up, ok in zip(SIGNS, rises, real >= 0, strict=True):
            assert not ok or up * choice[1] > 0
            seen += bool(ok)
    assert seen > 150


def test_four_real_numbers_come_in_order():
    rng = np.random.default_rng(7)
    for _ in range(50):
        roots = np.cumsum(rng.uniform(0.1, 2, 4)) - 3
        value = np.array(REAL(np.poly(roots)))[0]
        assert value[::-1] == pytest.approx(roots, abs=1e-8)


@pytest.mark.parametrize("function", [TRIGONOMETRIC, REAL])
@pytest.mark.parametrize("size", [0.0, 1e-12, 1.0, 1e9])
def test_every_argument_gives_finite_numbers(function, size):
    for pattern in itertools.product((-1, 0, 1), repeat=5):
        assert np.isfinite(np.array(function(size * np.array(pattern)))).all()


def test_double_roots_are_found_to_half_the_digits():
    for angle in (0.3, -2.0, 3.1):
        # (1 - cos(t - angle)) (cos t - 2), both factors expanded
        c, s = np.cos(angle), np.sin(angle)
        a = [-c / 2, -s / 2, 1 + 2 * c, 2 * s, -2 - c / 2]
        value = np.array(TRIGONOMETRIC(a))[0]
        off = np.abs(np.angle(np.exp(1j * (value - angle))))
        assert np.sort(off)[:2] == pytest.approx([0, 0], abs=1e-6)
    value = np.array(REAL(np.poly([1.5, 1.5, -2, 3])))[0]
    assert np.sort(value) == pytest.approx([-2, 1.5, 1.5, 3], abs=1e-6)


@pytest.mark.parametrize("function", [TRIGONOMETRIC, REAL])
def test_roots_move_with_the_coefficients(function):
    a = SX.sym("a", 5)
    jacobian = casadi.Function("J", [a], [casadi.jacobian(function(a)[0, :], a)])
    rng, step, seen = np.random.default_rng(8), 1e-6, 0
    for _ in range(20):
        point = rng.normal(size=5) * (1, 1, 1, 1, 0.2)
        value, real, _ = np.array(function(point))
        J = np.array(jacobian(point))
        assert np.isfinite(J).all()
        away = rng.normal(size=5)
        ahead, behind = (np.array(function(point + s * step * away))[0] for s in (1, -1))
        well = (real > 0.05) & (np.abs(value) < 3)
        assert (J @ away)[well] == pytest.approx(((ahead - behind) / (2 * step))[well], rel=1e-3)
        seen += np.count_nonzero(well)
    assert seen > 20
