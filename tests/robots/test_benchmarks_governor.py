"""The flyball governor (A05) against Lagrange's equations of its three symmetric coordinates."""

from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from support.errors import rms_error
from support.radau import solution

import mbs
from mbs.robots import flyball_governor

G, K, C, FREE = 9.81, 8e5, 4e4, 0.5
ROD, BALL, SLIDER, SHAFT = 0.3, 5.0, 3.0, 0.3
ACROSS, ALONG = ROD * (1 + 0.01**2) / 12, ROD * 2 * 0.01**2 / 12
ABOUT_Z = SLIDER * 2 * 0.1**2 / 12 + SHAFT * 2 * 0.01**2 / 12


def moment(alpha):
    """Of everything about the shaft, and its slope."""
    c, s = cos(alpha), sin(alpha)
    rod, ball = 0.05 + c / 2, 0.05 + c
    value = ROD * rod**2 + BALL * ball**2 + ACROSS * c**2 + ALONG * s**2
    slope = -ROD * rod * s - 2 * BALL * ball * s - 2 * (ACROSS - ALONG) * s * c
    return 2 * value + ABOUT_Z, 2 * slope


def spring(s, alpha, ds, dalpha):
    """Tension of a spring, and the slopes of its length."""
    x, z = cos(alpha) / 2, 1 - sin(alpha) / 2 - s
    length = sqrt(x**2 + z**2)
    by_s, by_alpha = -z / length, (-x * sin(alpha) / 2 - z * cos(alpha) / 2) / length
    return K * (length - FREE) + C * (by_s * ds + by_alpha * dalpha), by_s, by_alpha


def rates(y):
    _, s, alpha, ds, dalpha = y
    about, slope = moment(alpha)
    spin = START / about
    tension, by_s, by_alpha = spring(s, alpha, ds, dalpha)
    weight = (ROD / 2 + BALL) * G * cos(alpha)
    inertia = ROD / 4 + ACROSS + BALL
    dds = -2 * tension * by_s / SLIDER - G
    ddalpha = (spin**2 * slope / 4 + weight - tension * by_alpha) / inertia
    return np.array([spin, ds, dalpha, dds, ddalpha])


START = 2 * pi * moment(pi / 6)[0]
TIMES = np.linspace(0, 10, 1001)


@pytest.fixture(scope="module")
def reference():
    first = np.geomspace(1e-6, 1e-2, 60, endpoint=False)
    steps = np.concatenate([[0.0], first, np.linspace(0.01, 10, 3997)])
    found = solution(rates, [0, 0.5, pi / 6, 0, 0], steps)
    at = np.searchsorted(steps, TIMES - 1e-9)
    np.testing.assert_allclose(steps[at], TIMES, atol=1e-12)
    return found[at]


@pytest.fixture(scope="module")
def system():
    return flyball_governor().assemble()


@pytest.mark.parametrize(("tolerance", "limit"), [(1e-6, 1e-6), (1e-9, 1e-8)])
def test_governor(system, reference, tolerance, limit):
    result = mbs.simulate.run(system, 10.0, v0={"spin": 2 * pi}, tolerance=tolerance, quiet=True)
    found = np.column_stack([result[f"{name}.q"] for name in ("spin", "s", "alpha1")])
    assert rms_error(found, reference[:, :3]) < limit
    np.testing.assert_allclose(result["alpha2.q"], result["alpha1.q"], atol=1e-12)
    assert result["s.q"][-1] == pytest.approx(0.62, abs=0.005)  # of the published plot
    assert result["s.q"].max() == pytest.approx(0.743, abs=0.001)


def test_governor_loses_what_its_dampers_take(system):
    result = mbs.simulate.run(
        system, 2.0, v0={"spin": 2 * pi}, tolerance=1e-9, step=1e-3, quiet=True
    )
    s, alpha, ds, dalpha = (result[name] for name in ("s.q", "alpha1.q", "s.v", "alpha1.v"))
    x, z = np.cos(alpha) / 2, 1 - np.sin(alpha) / 2 - s
    rate = (-z * ds - (x * np.sin(alpha) + z * np.cos(alpha)) / 2 * dalpha) / np.hypot(x, z)
    total = result["kinetic_energy"] + result["potential_energy"]
    lost = np.trapezoid(2 * C * rate**2, result.time)
    assert lost > 1e-4
    assert total[0] - total[-1] == pytest.approx(lost, rel=2e-2)
    momentum = result["spin.v"] * [moment(a)[0] for a in alpha]
    np.testing.assert_allclose(momentum, START, rtol=1e-7)
