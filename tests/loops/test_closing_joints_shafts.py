"""Two shafts under an angle, joined by a constant-velocity joint."""

import numpy as np
import pytest

import mbs
import mbs.models
from mbs.components import Body, ConstantVelocity, Revolute, Universal
from mbs.loops import solve


def shafts(joint, angle):
    """Two shafts in bearings, whose axes meet under an angle."""
    m = mbs.Mechanism("shafts", gravity=(0, 0, 0))
    a, b = (m.add(Body(name, 1.0, (0, 0, 0), (0.1, 0.1, 0.2))) for name in "ab")
    m.connect(m.world, Revolute("left", actuated=True), a)
    m.connect(m.world.at(rotation=("y", angle)), Revolute("right"), b)
    m.connect(a, joint, b)
    return m


def test_constant_velocity_joint_turns_both_shafts_alike():
    system = shafts(ConstantVelocity("cv"), 0.6).assemble()
    assert system.closure.mobility == 1
    assert len(system.loops[0].rows) == 4
    for angle in np.linspace(-6, 6, 13):
        np.testing.assert_allclose(solve(system, {"left": angle}), angle, atol=1e-12)
    ddm = mbs.models.direct_dynamics(system)
    assert float(ddm([1.0, 1.0], 3.0, 2.0)) == pytest.approx(2.0 / 0.4, abs=1e-12)
    jointed = shafts(Universal("u"), 0.6).assemble()
    assert abs(np.diff(solve(jointed, {"left": 0.8})))[0] > 0.05


def test_half_a_turn_does_not_close_a_constant_velocity_joint():
    system = shafts(ConstantVelocity("cv"), 0.6).assemble(guess={"left": 0.0, "right": 3.1})
    left, right = system.configuration
    assert np.cos(right - left) == pytest.approx(1.0, abs=1e-12)
