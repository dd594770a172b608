"""Limits as vectors: joints, stops, quaternions, motors."""

import numpy as np
import pytest

import mbs
from mbs.components import Body, Free, JointStop, Mechanism, Prismatic, Revolute
from mbs.errors import ModelError
from mbs.models import limits


@pytest.fixture(scope="module")
def system():
    m = Mechanism("arm")
    base, upper, lower = (m.add(Body(name, mass=1, inertia=(1, 1, 1))) for name in "abc")
    m.connect(m.world, Free("base"), base)
    m.connect(base, Revolute("j1", limits=(-1, 2), actuated=True), upper)
    m.connect(upper, Prismatic("j2", limits=(-3, 3), actuated=False), lower)
    m.add(JointStop("stop", "j2", lower=-0.5, stiffness=10.0, width=0.1))
    return m.assemble()


def test_every_limit_is_in_its_place(system):
    found = limits(system, speed={"j1": 4.0}, effort={"j1": 9.0})
    inf = np.inf
    np.testing.assert_array_equal(found.q_lower, [-inf] * 3 + [-1] * 4 + [-1, -0.5])
    np.testing.assert_array_equal(found.q_upper, [inf] * 3 + [1] * 4 + [2, 3])
    np.testing.assert_array_equal(found.v_upper, [inf] * 6 + [4, inf])
    np.testing.assert_array_equal(found.v_lower, -found.v_upper)
    np.testing.assert_array_equal(found.tau_upper, [0] * 6 + [9, 0])
    np.testing.assert_array_equal(found.tau_lower, -found.tau_upper)


def test_motors_without_limits_are_unlimited():
    panda = mbs.load("panda").assemble()
    found = limits(panda)
    assert np.all(np.isinf(found.tau_upper))
    np.testing.assert_array_equal(found.q_upper[:3], [2.8973, 1.7628, 2.8973])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (dict(speed={"j3": 1.0}), "speed has 'j3'"),
        (dict(effort={"j2": 1.0}), "effort has 'j2', which has no motor"),
        (dict(effort={"j1": 0.0}), "effort of 'j1' is 0.0; give a number above zero"),
        (dict(speed={"j1": "fast"}), "speed of 'j1' is 'fast'"),
    ],
)
def test_what_is_refused(system, given, message):
    with pytest.raises(ModelError, match=message):
        limits(system, **given)
