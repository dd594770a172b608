"""The simple pendulum (A01) and the N-four-bar mechanism (A02) against elliptic functions."""

import numpy as np
import pytest
from support.elliptic import quarter_period, swing, whirl
from support.errors import rms_error

import mbs
from mbs.errors import DescriptionError
from mbs.robots import n_four_bar, simple_pendulum

LIMITS = {1e-6: 1e-4, 1e-9: 1e-6}
"""Of the library's measure, which accepts 1e-1 for a coarse and 1e-3 for a fine solution."""
SECONDS = 10.0
G = 9.81


def energy(result):
    return result["kinetic_energy"] + result["potential_energy"]


def test_closed_forms_obey_the_pendulum_equation():
    t = np.linspace(0, 3, 3001)
    h = t[1]
    for angle, rate in ((swing(t, 3.1, 2.5), 3.1), (whirl(t, 3.8, 1.0), 3.8)):
        second = (angle[2:] - 2 * angle[1:-1] + angle[:-2]) / h**2
        np.testing.assert_allclose(second, -(rate**2) * np.sin(angle[1:-1]), atol=2e-3)
    assert swing(0.0, 3.1, 2.5) == pytest.approx(2.5)
    assert whirl(0.0, 3.8, 1.0) == pytest.approx(np.pi)
    assert quarter_period(0.5) == pytest.approx(1.8540746773013719, abs=1e-15)


@pytest.mark.parametrize("tolerance", LIMITS)
def test_pendulum(tolerance):
    """The mass at x = -1 falls, and is on the other side after half a period."""
    result = mbs.simulate.run(
        simple_pendulum().assemble(), SECONDS, tolerance=tolerance, quiet=True
    )
    fallen = swing(result.time, np.sqrt(G), np.pi / 2)
    theta = result["theta.q"]
    assert theta[0] == pytest.approx(np.pi)
    place = np.column_stack([np.cos(theta), np.sin(theta)])
    reference = np.column_stack([-np.sin(fallen), -np.cos(fallen)])
    assert rms_error(place, reference) < LIMITS[tolerance]
    assert np.ptp(energy(result)) < 1e3 * tolerance
    assert place[:, 0].max() > 0.9999


@pytest.fixture(scope="module", params=[1, 2, 5, 10, 40])
def windows(request):
    """The number of windows, and their system."""
    return request.param, n_four_bar(request.param).assemble()


@pytest.mark.sweep
@pytest.mark.parametrize("tolerance", LIMITS)
def test_windows_whirl_through_every_singular_configuration(windows, tolerance):
    """On the parallelogram branch the uprights turn together and the couplers only translate.

    Then T = (N + 1) phi'^2 / 6 + N phi'^2 / 2 and U = g sin(phi) ((N + 1) / 2 + N).
    """
    loops, system = windows
    assert system.closure.mobility == 1
    result = mbs.simulate.run(system, SECONDS, v0={"a0": -1.0}, tolerance=tolerance, quiet=True)
    rate = np.sqrt(G * ((loops + 1) / 2 + loops) / ((loops + 1) / 3 + loops))
    hanging = whirl(result.time, rate, 1.0)
    phi = 1.5 * np.pi - hanging
    assert np.sum(np.diff(np.sign(np.sin(phi))) != 0) >= 10  # all rods on one line
    top = np.column_stack([np.cos(result["a0.q"]), np.sin(result["a0.q"])])
    reference = np.column_stack([np.cos(phi), np.sin(phi)])
    assert rms_error(top, reference) < LIMITS[tolerance]
    for k in range(1, loops + 1):
        np.testing.assert_allclose(result[f"a{k}.q"], result["a0.q"], atol=1e-11)
    assert np.ptp(energy(result)) < 2e3 * loops * tolerance
    assert result["closure_residual"].max() < 1e-10


@pytest.mark.parametrize("loops", [0, -1, 2.0, True, "3"])
def test_windows_are_counted(loops):
    with pytest.raises(DescriptionError, match="give the number of windows, 1 or more"):
        n_four_bar(loops)
