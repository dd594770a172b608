"""Motions under force elements: closed-form periods and orbits, energy, an FMU."""

import numpy as np
import pytest
from support.closed_mechanisms import planar_loop

import mbs
from mbs.components import (
    Body,
    Box,
    Bushing,
    Damper,
    Free,
    JointFriction,
    JointStop,
    Planar,
    PointGravity,
    PointMass,
    Prismatic,
    Revolute,
    Spring,
)


def slider(*elements):
    """A mass of 2 kg on a rail, without weight."""
    m = mbs.Mechanism("slider", gravity=(0, 0, 0))
    mass = m.add(Body("mass", mass=2.0, inertia=(0.1, 0.1, 0.1)))
    m.connect(m.world, Prismatic("x", axis="x", actuated=True), mass)
    for element in elements:
        m.add(element(m, mass))
    return m.assemble()


def run(system, duration, **options):
    return mbs.simulate.run(system, duration, quiet=True, tolerance=1e-10, **options)


def energy_of(result):
    return result["kinetic_energy"] + result["potential_energy"]


def test_damped_oscillation():
    """A mass that starts at 0.1 m from rest: m = 2, k = 50, c = 4, in closed form."""
    spring = slider(
        lambda m, b: Spring("s", m.world.at(-1), b, stiffness=50, length=1),
        lambda m, b: Damper("d", b, m.world.at(-1), damping=4),
    )
    result = run(spring, 2.0, q0={"x": 0.1})
    decay, frequency = 1.0, np.sqrt(25 - 1)
    t = result.time
    x = (
        0.1
        * np.exp(-decay * t)
        * (np.cos(frequency * t) + decay / frequency * np.sin(frequency * t))
    )
    np.testing.assert_allclose(result["x.q"], x, atol=1e-9)


def test_two_bodies_on_a_spring():
    """Free bodies of 1 and 3 kg with a spring between them swing with the reduced mass."""
    m = mbs.Mechanism("pair", gravity=(0, 0, 0))
    one, two = (m.add(Body(n, mass=w, inertia=(1, 1, 1))) for n, w in (("one", 1), ("two", 3)))
    m.connect(m.world, Free("a"), one)
    m.connect(m.world, Free("b"), two)
    m.add(Spring("s", one, two, stiffness=12, length=1))
    result = run(m.assemble(), 3.0, q0={"b.x": 1.2})
    gap = result["b.x.q"] - result["a.x.q"]
    np.testing.assert_allclose(gap, 1 + 0.2 * np.cos(4 * result.time), atol=1e-9)
    np.testing.assert_allclose(result["a.x.q"] + 3 * result["b.x.q"], 3.6, atol=1e-9)


def test_orbit_under_central_gravity():
    """An ellipse of Kepler: mu = 1, from the far end at 1.5 with half axis 1, in one period."""
    m = mbs.Mechanism("orbit", gravity=(0, 0, 0))
    satellite = m.add(PointMass("satellite", mass=2.0))
    m.connect(m.world, Planar("p", actuated=False), m.add(Body("frame", inertia=(1, 1, 1), mass=0)))
    m.connect(m.components["frame"], satellite)
    m.add(PointGravity("gravity", m.world, satellite, strength=2.0))
    speed = np.sqrt(2 / 1.5 - 1)
    result = run(m.assemble(), 2 * np.pi, q0={"p.s_x": 1.5}, v0={"p.s_y": speed}, step=np.pi / 50)
    half = len(result.time) // 2
    assert result["p.s_x.q"][half] == pytest.approx(-0.5, abs=1e-8)
    assert result["p.s_x.q"][-1] == pytest.approx(1.5, abs=1e-7)
    np.testing.assert_allclose(energy_of(result), -2 / 2, atol=1e-9)


def test_bounce_between_stops_keeps_its_energy():
    system = slider(
        lambda m, b: JointStop("s", joint="x", lower=-1, upper=1, stiffness=5e3, width=0.01)
    )
    result = run(system, 5.0, v0={"x": 3.0})
    np.testing.assert_allclose(energy_of(result), 9.0, rtol=1e-7)
    assert 1.05 < np.abs(result["x.q"]).max() < 1.1
    assert np.sum(np.diff(np.sign(result["x.v"])) != 0) > 5


def test_friction_brings_a_mass_to_rest():
    """Coulomb friction alone: the way is m v^2 / (2 F)."""
    system = slider(lambda m, b: JointFriction("f", joint="x", coulomb=4, width=1e-4))
    result = run(system, 1.5, v0={"x": 2.0})
    assert result["x.q"][-1] == pytest.approx(1.0, abs=1e-4)
    assert abs(result["x.v"][-1]) < 1e-6


@pytest.mark.parametrize("seed", range(2))
def test_a_four_bar_on_springs_keeps_its_energy(seed):
    m, guess = planar_loop(seed, links=3)
    bars = list(m.bodies())
    m.add(Spring("diagonal", bars[0], bars[2].at(0.2), stiffness=200, length=0.3))
    m.add(Bushing("mount", m.world, bars[1], stiffness=20, angular_stiffness=5))
    result = run(m.assemble(guess=guess), 2.0)
    total = energy_of(result)
    assert np.ptp(result["kinetic_energy"]) > 1
    assert np.abs(total - total[0]).max() < 1e-6
    assert result["closure_residual"].max() < 1e-9


def test_energy_that_a_damper_takes_from_a_pendulum():
    """The loss of energy is the time integral of c (dL/dt)^2."""
    m = mbs.Mechanism("pendulum")
    bar = m.add(Box("bar", length=1, mass=1))
    m.connect(m.world, Revolute("j", axis="y", actuated=True), bar)
    m.add(Damper("d", m.world.at(0, 0, 1), bar.right, damping=3))
    result = run(m.assemble(), 2.0, step=1e-3)
    angle, speed = result["j.q"], result["j.v"]
    L = np.hypot(np.cos(angle), 1 + np.sin(angle))
    power = 3 * (np.cos(angle) * speed / L) ** 2
    lost = np.concatenate([[0], np.cumsum((power[1:] + power[:-1]) / 2) * 1e-3])
    np.testing.assert_allclose(energy_of(result)[0] - energy_of(result), lost, atol=1e-5)
    assert lost[-1] > 1


def test_elements_in_an_fmu(tmp_path):
    """The FMU moves as the simulation does, its spring a parameter."""
    pytest.importorskip("fmpy")
    m = mbs.Mechanism("swing", parameters={"k": 30.0})
    bar = m.add(Box("bar", length=1, mass=1))
    m.connect(m.world, Revolute("j", axis="y", actuated=True), bar)
    m.add(Spring("s", m.world.at(0, 0, 1), bar.right, stiffness="k", length=0.5, damping=1))
    m.add(JointStop("stop", joint="j", upper=0.3, stiffness=200, damping=3, width=0.1))
    system = m.assemble()
    path = tmp_path / "swing.fmu"
    mbs.export.fmu(system, path)
    for k in (30.0, 60.0):
        ours = run(system, 1.0, q0={"j": 0.2}, parameters={"k": k})
        theirs = mbs.simulate.fmu(
            path, 1.0, start={"j.q": 0.2}, parameters={"k": k}, step=0.01, quiet=True
        )
        np.testing.assert_allclose(theirs["j.q"], ours["j.q"], atol=1e-5)
