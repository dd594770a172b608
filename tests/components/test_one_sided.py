"""Gaps, backlash, stops and ropes: what touches never pulls, and a rope never pushes."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mbs
from mbs.components import (
    Body,
    ElasticRope,
    ElastoBacklash,
    ElastoGap,
    FixedFlange,
    HydraulicCylinder,
    JointStop,
    Prismatic,
    ShaftInertia,
    SlidingMass,
)

STIFFNESS, DAMPING = 1e3, 60.0
"""Of masses of 1: the damper would exceed the spring for most of an impact."""


def slide():
    m = mbs.Mechanism("slide", gravity=(0, 0, 0))
    body = m.add(Body("b", mass=1.0))
    m.connect(m.world, Prismatic("x", axis="x"), body)
    return m, body


def stop():
    """Below zero, where positive efforts push."""
    m, _ = slide()
    law = {"stiffness": STIFFNESS, "damping": DAMPING, "width": 1e-3}
    m.add(JointStop("c", joint="x", lower=0.0, **law))
    return m.assemble(), "x", lambda r: r["c.effort"]


def gap():
    m = mbs.Mechanism("gap", gravity=(0, 0, 0))
    mass, wall = SlidingMass("x", mass=1.0), FixedFlange("wall")
    element = ElastoGap("c", stiffness=STIFFNESS, damping=DAMPING)
    m.connect(wall.flange, element.flange_a)
    m.connect(element.flange_b, mass.flange_a)
    return m.assemble(), "x", lambda r: -r["c.force"]


def backlash():
    m = mbs.Mechanism("backlash", gravity=(0, 0, 0))
    inertia, wall = ShaftInertia("x", 1.0), FixedFlange("wall")
    element = ElastoBacklash("c", stiffness=STIFFNESS, damping=DAMPING, backlash=0.0, width=1e-4)
    m.connect(inertia.flange_a, element.flange_a)
    m.connect(element.flange_b, wall.flange)
    return m.assemble(), "x"


def rope():
    """Taut above 1 m; it draws back."""
    m, body = slide()
    law = {"stiffness": STIFFNESS, "damping": DAMPING, "length": 1.0}
    m.add(ElasticRope("c", [m.world.at(0, 0, 0), body], **law))
    return m.assemble(), "x", lambda r: r["c.tension"]


@pytest.mark.parametrize(("made", "start"), [(stop, -1.0), (gap, -1.0), (rope, 1.0)])
def test_what_touches_once_never_pulls(made, start):
    system, name, push = made()
    q0 = 0.9 if made is rope else 0.1
    result = mbs.simulate.run(system, 0.4, q0={name: q0}, v0={name: start}, step=1e-4, quiet=True)
    assert push(result).max() > 5.0
    assert push(result).min() >= 0.0
    assert result[f"{name}.v"][-1] * start < -0.01  # it returns


def test_flanks_of_a_backlash_never_pull():
    system, name = backlash()
    result = mbs.simulate.run(system, 0.4, v0={name: 1.0}, step=1e-4, quiet=True)
    torque, x = result["c.torque"], result["x.q"]
    assert np.max(torque) > 5.0
    assert np.all(torque * x >= 0.0)


def test_ends_of_a_cylinder_never_pull():
    m, body = slide()
    law = {"area_a": 1e-4, "area_b": 1e-4, "closed": 0.5, "stroke": 0.5, "bulk": 1e-3}
    ends = {"end_stiffness": STIFFNESS, "end_damping": DAMPING, "end_width": 1e-4}
    m.add(HydraulicCylinder("c", m.world.at(0, 0, 0), body, **law, **ends))
    result = mbs.simulate.run(
        m.assemble(), 0.4, q0={"x": 0.6}, v0={"x": -1.0}, step=1e-4, quiet=True
    )
    assert result["c.force"].max() > 5.0
    assert result["c.force"].min() > -1e-6  # the oil is as soft as can be
    assert result["x.v"][-1] > 0.01


@pytest.mark.parametrize("method", ["dopri5", "rodas"])
def test_a_backlash_follows_the_law_of_modelica(method):
    """The example Rotational.Backlash: pi/4 of play, released from pi/2."""
    k, c, play, J = 20e3, 50.0, np.pi / 4, 5.0

    def torque(x, w):
        spring = k * max(abs(x) - play / 2, 0.0)
        return -np.sign(x) * spring - np.clip(c * w, -spring, spring)

    found = solve_ivp(
        lambda _, y: [y[1], torque(*y) / J],
        (0, 1),
        [np.pi / 2, 0],
        t_eval=np.linspace(0, 1, 101),
        rtol=1e-10,
        atol=1e-12,
        max_step=1e-4,
    )
    m = mbs.Mechanism("backlash", gravity=(0, 0, 0))
    inertia, wall = ShaftInertia("i", J), FixedFlange("wall")
    element = ElastoBacklash("c", stiffness=k, damping=c, backlash=play, width=1e-6)
    m.connect(wall.flange, element.flange_a)
    m.connect(element.flange_b, inertia.flange_a)
    result = mbs.simulate.run(m.assemble(), 1.0, q0={"i": np.pi / 2}, method=method, quiet=True)
    np.testing.assert_allclose(result["i.q"], found.y[0], rtol=0, atol=2e-4)
    assert np.abs(result["i.v"]).max() > 10
