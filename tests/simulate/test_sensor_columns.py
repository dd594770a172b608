"""Readings of sensors in results."""

import numpy as np
from support.observed_four_bar import four_bar

import mbs
import mbs.simulate
from mbs.components import AbsoluteSensor, Body, PowerSensor, Revolute, WrenchSensor


def test_columns_of_a_simulation():
    m = mbs.Mechanism("pendulum", gravity=(0, -9.81, 0))
    bob = m.add(Body("bob", mass="M", com=(0, "-L", 0)))
    m.values = {"M": mbs.Parameter("M", 2.0), "L": mbs.Parameter("L", 0.7)}
    m.connect(m.world, Revolute("j", actuated=False), bob)
    m.add(AbsoluteSensor("tip", bob.at(0, "-L", 0), quantities=("p", "v")))
    m.add(WrenchSensor("pin", "j"))
    m.add(PowerSensor("power", "j"))
    system = m.assemble()
    options = dict(q0={"j": 1.0}, quiet=True, tolerance=1e-10)
    result = mbs.simulate.run(system, 1.0, parameters={"L": 0.5}, **options)
    q, w = result["j.q"], result["j.v"]
    np.testing.assert_allclose(result["tip.p.x"], 0.5 * np.sin(q), atol=1e-12)
    np.testing.assert_allclose(result["pin.f.y"], 2 * (9.81 * np.cos(q) + 0.5 * w**2), atol=1e-9)
    assert result.units["pin.m.z"] == "N.m"
    assert result.units["power.P"] == "W"
    assert np.abs(result["power.P"]).max() < 1e-9


def test_columns_of_a_closed_simulation_with_a_motor():
    """Sensors read the motor that is there, through configurations where the driven rocker turns
    back."""
    system = four_bar(driven="j4")
    options = dict(v0={"j1": 9.0}, step=0.002, quiet=True, tolerance=1e-10)
    result = mbs.simulate.run(system, 1.0, tau={"j4": 2.0}, **options)
    assert np.sum(np.diff(np.sign(result["j4.v"])) != 0) >= 2
    np.testing.assert_allclose(result["p4.P"], 2.0 * result["j4.v"], atol=1e-6)
    np.testing.assert_allclose(result["p1.P"], 0, atol=1e-6)
    slope = np.gradient(np.unwrap(result["e3.q"]), result.time)
    assert np.ptp(slope) > 1
    np.testing.assert_allclose(result["e3.v"][2:-2], slope[2:-2], atol=0.05)
