"""Andrews' squeezer (A03) against published digits and free bodies, cranks against one equation."""

from math import pi

import numpy as np
import pytest
from support.extrapolation import solution
from support.planar_bodies import GROUND, Pin, PlanarBodies

import mbs
from mbs.robots import andrews_squeezer, single_cylinder_engine, slider_crank

TORQUE = 0.033
PUBLISHED = {  # Mazzia & Magherini 2008, at t = 0.03 s
    "beta": 0.1581077119629904e2,
    "theta": -0.1575637105984298e2,
    "gamma": 0.4082224013073101e-1,
    "phi": -0.5347301163226948,
    "delta": 0.5244099658805304,
    "omega": 0.5347301163226948,
    "epsilon": 0.1048080741042263e1,
}
NAMES = tuple(PUBLISHED)
A, B, C = -0.06934 - 0.00227j, -0.03635 + 0.03273j, 0.014 + 0.072j


def seven_bodies():
    """Centres, from the joint nearest to the drive, and the pins in the axes of the bodies."""
    com = [0.00092, -0.0115, 0.01043 - 0.01874j, -0.00579j, 0.02308 + 0.00916j, 0.00579, 0]
    com[6] = -0.00449 - 0.01228j
    ends = ((1, -0.028, 2, -0.035j), (1, -0.028, 3, -0.02j), (1, -0.028, 5, 0.02))
    hinges = (
        (GROUND, 0, 0, 0),
        (0, 0.007, 1, 0),
        (GROUND, B, 2, 0),
        (4, 0.04, 3, 0),
        (GROUND, A, 4, 0),
        (6, -0.04j, 5, 0),
        (GROUND, A, 6, 0),
    )

    def seen(k, at):
        return at if k == GROUND else at - com[k]

    pins = [Pin(i, seen(i, p), j, seen(j, q)) for i, p, j, q in (*hinges, *ends)]

    def loads(places, angles):
        forces, moments = np.zeros(7, dtype=complex), np.zeros(7)
        moments[0] = TORQUE
        arm = np.exp(1j * angles[2]) * (0.02 - 0.018j - com[2])
        pull = C - (places[2] + arm)
        forces[2] = 4530 * (abs(pull) - 0.07785) * pull / abs(pull)
        moments[2] = (arm.conjugate() * forces[2]).imag
        return forces, moments

    masses = np.array([0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498])
    about = np.array([2.194e-6, 4.41e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5])
    return PlanarBodies(masses, about, pins, loads), com


def free_state(q, com):
    """The state of the bodies at rest where the mechanism has these angles."""
    beta, theta, gamma, phi, delta, omega, epsilon = q
    angles = [beta, beta + theta, gamma, phi + delta, delta, omega + epsilon, epsilon]
    turn = np.exp(1j * np.array(angles))
    roots = [0, 0.007 * turn[0], B, A + 0.04 * turn[4], A, A - 0.04j * turn[6], A]
    places = np.array(roots) + turn * com
    y = np.column_stack([places.real, places.imag, angles]).ravel()
    return np.concatenate([y, 0 * y])


@pytest.fixture(scope="module")
def squeezer():
    return andrews_squeezer().assemble()


def squeezed(system, tolerance):
    return mbs.simulate.run(
        system, 0.05, tau={"beta": TORQUE}, step=5e-4, tolerance=tolerance, quiet=True
    )


def test_squeezer_reaches_the_published_digits(squeezer):
    result = squeezed(squeezer, 1e-11)
    assert result.time[60] == pytest.approx(0.03)
    for name, value in PUBLISHED.items():
        assert result[f"{name}.q"][60] == pytest.approx(value, abs=1e-8)


@pytest.mark.parametrize(("tolerance", "limit"), [(1e-6, 1e-4), (1e-9, 1e-7)])
def test_squeezer_against_free_bodies(squeezer, tolerance, limit):
    """Also beyond the published interval, where the crank turns five times."""
    model, com = seven_bodies()
    configuration = dict(
        zip((c.name for c in squeezer.coordinates), squeezer.configuration, strict=True)
    )
    start = free_state([configuration[name] for name in NAMES], com)
    assert np.max(np.abs(model.gaps(start))) < 1e-15
    end = solution(model.rates, start, [0, 0.05], 1e-12, first=1e-4)[-1]
    assert np.max(np.abs(model.gaps(end))) < 1e-9
    result = squeezed(squeezer, tolerance)
    found = free_state([result[f"{name}.q"][-1] for name in NAMES], com)
    assert end[2] > 10 * pi
    np.testing.assert_allclose(found[2:21:3], end[2:21:3], atol=limit)
    assert result["closure_residual"].max() < 1e-12


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
def test_squeezer_gains_the_work_of_its_motor(squeezer, tolerance):
    result = squeezed(squeezer, tolerance)
    total = result["kinetic_energy"] + result["potential_energy"]
    work = TORQUE * (result["beta.q"] - result["beta.q"][0])
    assert work[-1] > 1
    np.testing.assert_allclose(total - total[0], work, atol=50 * tolerance)


class Crank:
    """Crank of radius r from the axis of the slide, rod of given length: T = m(phi) phi'^2 / 2."""

    def __init__(self, r, length, rotor, rod, about_com, slider):
        self.r, self.length, self.rotor = r, length, rotor
        self.rod, self.about_com, self.slider = rod, about_com, slider

    def motion(self, phi):
        """Place of rod's middle and slider over the crank, complex; slopes; slope of the rod."""
        sine = self.r * np.sin(phi) / self.length
        rod = np.sqrt(1 - sine**2) - 1j * sine
        turn = -self.r * np.cos(phi) / (self.length * rod.real)
        crank = self.r * np.exp(1j * phi)
        middle, slope = crank + self.length / 2 * rod, 1j * (crank + self.length / 2 * turn * rod)
        return (
            middle,
            slope,
            crank + self.length * rod,
            1j * (crank + self.length * turn * rod),
            turn,
        )

    def mass(self, phi):
        _, slope, _, slide, turn = self.motion(phi)
        return (
            self.rotor
            + self.rod * abs(slope) ** 2
            + self.about_com * turn**2
            + self.slider * slide.real**2
        )

    def turned(self, times, speed, height=lambda phi: 0.0):
        """phi(t) from phi = 0; `height` is the potential energy [J]."""
        energy = self.mass(0.0) * speed**2 / 2 + height(0.0)

        def rate(t, y):
            return np.sqrt(2 * (energy - height(y[0])) / self.mass(y[0])).reshape(1)

        return solution(rate, [0.0], times, 1e-12, first=times[1])[:, 0]


@pytest.mark.parametrize(("tolerance", "limit"), [(1e-6, 2e-4), (1e-9, 2e-7)])
def test_slider_crank(tolerance, limit):
    system = slider_crank().assemble()
    assert system.closure.mobility == 1
    result = mbs.simulate.run(
        system, 0.1, v0={"crank": 150}, step=2e-3, tolerance=tolerance, quiet=True
    )
    rod, length = 0.151104, 0.30
    about_com = 0.0045339259 - rod * length**2 / 4
    model = Crank(0.15, length, 0.002727, rod, about_com, 0.075552)
    phi = model.turned(result.time, 150.0)
    np.testing.assert_allclose(result["crank.q"], phi, atol=limit)
    np.testing.assert_allclose(result["slide.q"], model.motion(phi)[2].real, atol=limit)
    assert np.ptp(result["kinetic_energy"]) < 2e3 * tolerance


@pytest.mark.parametrize(("tolerance", "limit"), [(1e-6, 5e-4), (1e-9, 5e-7)])
def test_engine(tolerance, limit):
    system = single_cylinder_engine().assemble()
    assert system.closure.mobility == 1
    result = mbs.simulate.run(
        system, 5.0, v0={"crank": 10}, step=0.05, tolerance=tolerance, quiet=True
    )
    steel, g, r, length = 7700, 9.80665, 0.1, 0.2
    shaft, throw, web = (steel * v for v in (pi * 0.025**2 * 0.1, pi * 0.015**2 * 0.1, 1e-4))
    rod, piston = steel * 0.02 * 0.2 * 0.06, steel * pi * 0.05**2 * 0.1
    webs = 2 * web * ((0.1**2 + 0.05**2) / 12 + 0.05**2)
    rotor = 1 + shaft * 0.025**2 / 2 + webs + throw * (0.015**2 / 2 + r**2)
    model = Crank(r, length, rotor, rod, rod * (0.2**2 + 0.06**2) / 12, piston)

    def height(phi):
        middle, _, slider, _, _ = model.motion(phi)
        raised = (2 * web * 0.05 + throw * r) * np.cos(phi)
        return g * (raised + rod * middle.real + piston * slider.real)

    phi = model.turned(result.time, 10.0, height)
    assert phi[-1] > 16 * pi
    np.testing.assert_allclose(result["crank.q"], phi, atol=limit)
    down = 0.45 - 0.1 - model.motion(phi)[2].real
    np.testing.assert_allclose(result["cylinder.q"], down, atol=limit)
    total = result["kinetic_energy"] + result["potential_energy"]
    assert np.ptp(total) < 1e3 * tolerance
