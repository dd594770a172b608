"""Motions of springs and rotors against closed forms and conservation laws."""

import numpy as np
import pytest
from support.driven_trees import driven_tree

import mbs.simulate
from mbs import Mechanism
from mbs.components import (
    Body,
    Free,
    PointMass,
    Prismatic,
    Revolute,
    Rotor,
)


def test_mass_on_a_spring_swings_about_where_gravity_is_held():
    m = Mechanism("spring", gravity=(0, 0, -9.81))
    spring = Prismatic("s", axis="z", stiffness=50, rest=0.4, actuated=False)
    m.connect(m.world, spring, m.add(PointMass("mass", mass=2)))
    rise = 0.4 - 2 * 9.81 / 50
    result = mbs.simulate.run(m.assemble(), 3.0, q0={"s": rise + 0.1}, tolerance=1e-11)
    expected = rise + 0.1 * np.cos(np.sqrt(50 / 2) * result.time)
    np.testing.assert_allclose(result["s.q"], expected, atol=1e-8)


def elastic_drive(inertia, ratio, stiffness, arm):
    """A motor with a gear, a spring behind it, and an arm of this inertia."""
    m = Mechanism("elastic", gravity=(0, 0, 0))
    shaft = m.add(Body("shaft", mass=0))
    body = m.add(Body("arm", mass=1, inertia=(1, 1, arm)))
    m.connect(m.world, Revolute("motor", rotor=Rotor(inertia=inertia, ratio=ratio)), shaft)
    m.connect(shaft, Revolute("spring", stiffness=stiffness, actuated=False), body)
    return m.assemble()


def test_elastic_transmission_has_its_frequency():
    rotor, arm, stiffness = 1e-4 * 100**2, 0.3, 400.0
    system = elastic_drive(1e-4, 100, stiffness, arm)
    result = mbs.simulate.run(system, 1.0, q0={"spring": 0.01}, tolerance=1e-12)
    frequency = np.sqrt(stiffness * (1 / rotor + 1 / arm))
    swing = 0.01 * np.cos(frequency * result.time)
    np.testing.assert_allclose(result["spring.q"], swing, atol=1e-9)
    np.testing.assert_allclose(result["motor.q"], (0.01 - swing) * arm / (rotor + arm), atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_energy_of_driven_trees_is_kept(seed):
    system = driven_tree(seed).assemble()
    rng = np.random.default_rng(seed)
    v0 = {speed.name: rng.uniform(-1, 1) for speed in system.velocity_coordinates}
    result = mbs.simulate.run(system, 1.0, v0=v0, tolerance=1e-11)
    total = result["kinetic_energy"] + result["potential_energy"]
    assert np.ptp(total) < 1e-7 * result["kinetic_energy"].max()
    assert np.ptp(result["kinetic_energy"]) > 0.1


def test_satellite_turns_against_its_wheel():
    """A wheel that speeds up turns a satellite; tilting the satellite makes it precess."""
    m = Mechanism("satellite", gravity=(0, 0, 0))
    satellite = m.add(Body("satellite", mass=12, inertia=(2, 3, 4)))
    m.connect(m.world, Free("float"), satellite)
    wheel = Revolute("wheel", axis="z", rotor=Rotor(inertia=0.01, ratio=1.0))
    m.connect(satellite, wheel, m.add(Body("hub", mass=0)))
    result = mbs.simulate.run(
        m.assemble(), 2.0, tau={"wheel": 0.05}, v0={"float.wx": 0.3}, tolerance=1e-11
    )
    spin = 0.01 * result["wheel.v"]
    w = np.stack([result[f"float.w{k}.v"] for k in "xyz"])
    momentum = np.array([2.0, 3.0, 4.0])[:, None] * w
    momentum[2] += spin
    np.testing.assert_allclose(np.linalg.norm(momentum, axis=0), 0.6, atol=1e-7)
    assert spin[-1] > 0.09
    assert abs(w[1]).max() > 0.004
