"""Bricard's mechanism (A04) and Modelica's Fourbar1 against a chain in plain numpy."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from support.errors import rms_error
from support.extrapolation import solution
from support.spatial_chain import Chain, Part, X, Y, Z

import mbs
from mbs.models.state.tree import full_state
from mbs.robots import bricard, modelica_four_bar, modelica_rod_four_bar
from mbs.solvers import integrate

SPEED = 5.235987755982989
STEP = 0.1


def box(start, along):
    """Mass, com and inertia of a rod of 1 m, 1 kg and 0.1 m x 0.1 m."""
    across, lengthways = (1 + 0.1**2) / 12, 2 * 0.1**2 / 12
    axis = np.outer(along, along)
    return 1.0, start + along / 2, across * np.eye(3) + (lengthways - across) * axis


def tube(start, r, density=7700, radius=0.025):
    """Mass, com and inertia of a round bar."""
    length = np.linalg.norm(r)
    mass = density * pi * radius**2 * length
    across, lengthways = mass * (3 * radius**2 + length**2) / 12, mass * radius**2 / 2
    axis = np.outer(r, r) / length**2
    return mass, start + r / 2, across * np.eye(3) + (lengthways - across) * axis


def six_hinges():
    """Round the edges of a cube; the sixth hinge leaves one turn of the last rod free."""
    corners = np.array([0 * X, X, X - Y, X - Y + Z, -Y + Z, Z])
    ends = zip(corners, corners[1:], (Y, Z, X, Y, Z), strict=False)
    parts = [Part(start, axis, *box(start, end - start)) for start, end, axis in ends]
    return Chain(parts, corners[5], [0, 1, 2, 4, 5], 4, np.array([0, -9.81, 0]))


def four_bar():
    """From the crank through the rod down to the foot, which may only slide along x."""
    pin, head, foot = np.array([0, 0.5, 0.1]), np.array([1, 0.2, 0]), X
    parts = [
        Part(np.zeros(3), X, *tube(np.zeros(3), pin)),
        Part(pin, X),
        Part(pin, Y),
        Part(pin, Z, *tube(pin, head - pin)),
        Part(head, Z),
        Part(head, Y, *tube(head, foot - head)),
    ]
    return Chain(parts, foot, [1, 2, 3, 4, 5], 5, np.array([0, -9.80665, 0]))


def motion(chain, v0, duration):
    """Positions and velocities of the chain every 0.1 s, (m, 2 n)."""
    n = len(chain.parts)

    def rates(t, x):
        return np.concatenate([x[n:], chain.accelerations(x[:n], x[n:])])

    x0 = np.concatenate([np.zeros(n), v0])
    np.testing.assert_allclose(chain.closed(x0), x0, atol=1e-12)
    times = STEP * np.arange(round(duration / STEP) + 1)
    return solution(rates, x0, times, 1e-9, chain.closed, first=STEP)


def columns(result, names):
    return np.column_stack([result[f"{name}.q"] for name in names])


def energy(result):
    return result["kinetic_energy"] + result["potential_energy"]


@pytest.fixture(scope="module")
def cube():
    chain = six_hinges()
    return chain, motion(chain, np.zeros(5), 3.0)


@pytest.mark.parametrize(("tolerance", "limit"), [(1e-6, 1e-4), (1e-9, 1e-6)])
def test_bricard(cube, tolerance, limit):
    """Half a period and more: through the lowest configuration and on."""
    chain, reference = cube
    system = bricard().assemble()
    assert system.closure.mobility == 1
    assert len(system.closure.rows) == 4
    result = mbs.simulate.run(system, 3.0, step=STEP, tolerance=tolerance, quiet=True)
    q = columns(result, ("j1", "j2", "j3", "j4", "j5"))
    P3 = np.array([chain.point(row, 2, X - Y + Z) for row in q])
    expected = np.array([chain.point(row[:5], 2, X - Y + Z) for row in reference])
    assert np.ptp(expected[:, 1]) > 0.5
    assert rms_error(P3, expected) < limit


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
def test_bricard_closes_with_every_row_for_ten_seconds(tolerance):
    """All five rows, not only the four that are kept; and it comes back after a period of 5 s."""
    result = mbs.simulate.run(bricard().assemble(), 10.0, tolerance=tolerance, quiet=True)
    assert result["closure_residual"].max() < 1e-12
    assert np.ptp(energy(result)) < 1e3 * tolerance
    q = columns(result, ("j1", "j2", "j3", "j4", "j5"))
    np.testing.assert_allclose(q[:, ::2], q[:, [0]] @ np.ones((1, 3)), atol=1e-6)
    back = np.abs(q).max(axis=1)[100:]
    assert result.time[100 + back.argmin()] == pytest.approx(5.0, abs=0.05)


@pytest.mark.parametrize(("tolerance", "limit"), [(1e-6, 1e-4), (1e-9, 1e-6)])
def test_modelica_four_bar(tolerance, limit):
    chain = four_bar()
    v0 = SPEED * np.array([1, -1, 0.5, 0.1, -0.1, -0.5])
    reference = motion(chain, v0, 0.6)
    system = modelica_four_bar().assemble()
    result = mbs.simulate.run(
        system, 0.6, v0={"j1": SPEED}, step=STEP, tolerance=tolerance, quiet=True
    )
    found = columns(result, ("j1", "j3", "j4", "rev1", "rev"))
    signed = reference[:, [0, 1, 2, 4, 5]] * [1, 1, 1, -1, -1]
    assert rms_error(found, signed) < limit
    foot = [chain.point(row[:6], 5, X)[0] - 1.2 for row in reference]
    assert rms_error(result["j2.q"], foot) < limit


def test_modelica_four_bar_after_five_seconds():
    """Six turns of the crank: 40.329 rad of an integration in quadruple precision."""
    system = modelica_four_bar().assemble()
    result = mbs.simulate.run(system, 5.0, v0={"j1": SPEED}, tolerance=1e-9, quiet=True)
    assert result["j1.q"][-1] == pytest.approx(40.329, abs=5e-4)
    assert np.ptp(energy(result)) < 1e-5
    assert result["closure_residual"].max() < 1e-12


def test_modelica_rod_four_bar_after_five_seconds():
    """Without the mass of the rod 40.242 rad, of an integration in quadruple precision."""
    system = modelica_rod_four_bar().assemble()
    result = mbs.simulate.run(system, 5.0, v0={"j1": SPEED}, tolerance=1e-9, quiet=True)
    assert result["j1.q"][-1] == pytest.approx(40.242, abs=5e-4)
    assert np.ptp(energy(result)) < 1e-5


def test_bricard_moves_alike_with_other_rows():
    """Four of the five rows are independent; which ones are kept makes no difference."""
    system = bricard().assemble()
    ends = []
    for rows in ((0, 1, 2, 4), (0, 1, 2, 3), (0, 1, 3, 4)):
        closure = replace(system.closure, rows=rows)
        state = full_state(replace(system, closure=closure, _cache={}))
        start = np.concatenate([system.configuration, np.zeros(system.nv)])
        times = np.linspace(0.0, 3.0, 31)
        options = {"project": state.project, "rtol": 1e-11, "atol": 1e-11}
        ends.append(integrate(state.rhs, start, times, **options))
    for other in ends[1:]:
        np.testing.assert_allclose(other, ends[0], atol=1e-6)
