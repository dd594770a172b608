"""Limits as vectors: joints, stops, quaternions, motors."""

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

from mbs import Mechanism
from mbs.components import (
    Body,
    Free,
    JointStop,
    Prismatic,
    Revolute,
)
from mbs.errors import DescriptionError, ModelError
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
    assert not np.signbit(found.tau_lower[found.tau_lower == 0]).any()


def test_motors_without_limits_are_unlimited():
    found = limits(catalogue_system("rx90"))
    assert np.all(np.isinf(found.tau_upper))
    assert np.all(np.isinf(found.v_lower))


def test_velocities_and_efforts_are_those_of_the_description():
    panda = catalogue_system("panda")
    found = limits(panda)
    np.testing.assert_array_equal(found.q_upper[:3], [2.8973, 1.7628, 2.8973])
    np.testing.assert_array_equal(found.v_upper, [2.175] * 4 + [2.61] * 3)
    np.testing.assert_array_equal(found.tau_upper, [87] * 4 + [12] * 3)
    given = limits(panda, speed={"q1": 1.0}, effort={"q7": 5.0})
    np.testing.assert_array_equal(given.v_lower, [-1, *found.v_lower[1:]])
    np.testing.assert_array_equal(given.tau_upper, [*found.tau_upper[:6], 5])


def test_ranges_need_not_be_the_same_in_both_directions():
    m = Mechanism("slide")
    body = m.add(Body("body", mass=1))
    m.connect(m.world, Prismatic("s", velocity=(-0.5, 2), effort=(0, 30)), body)
    found = limits(m.assemble())
    assert (found.v_lower[0], found.v_upper[0]) == (-0.5, 2)
    assert (found.tau_lower[0], found.tau_upper[0]) == (0, 30)


def test_a_joint_without_motor_has_no_effort():
    m = Mechanism("slide")
    m.connect(m.world, Prismatic("s", actuated=False, effort=5), m.add(Body("body", mass=1)))
    assert limits(m.assemble()).tau_upper[0] == 0


def test_numbers_of_numpy_are_numbers(system):
    assert limits(system, speed={"j1": np.float32(0.5)}).v_upper[6] == 0.5
    assert limits(system, effort={"j1": np.int64(3)}).tau_lower[6] == -3


def test_a_stop_beyond_the_limits_is_refused():
    m = Mechanism("slide")
    m.connect(m.world, Prismatic("s", limits=(0, 1)), m.add(Body("body", mass=1)))
    m.add(JointStop("stop", "s", lower=2.0, stiffness=10.0, width=0.1))
    with pytest.raises(ModelError, match="'s' leave it nothing between 2 and 1; let them overlap"):
        limits(m.assemble())


@pytest.mark.parametrize(
    ("joint", "message"),
    [
        (lambda: Revolute("j", velocity=0), "j: velocity is 0; give the largest one, above zero"),
        (lambda: Revolute("j", effort=(1, 2)), r"j: effort is \(1, 2\); give the largest one"),
        (lambda: Revolute("j", effort="much"), "j: effort is 'much'"),
        (lambda: Revolute("j", effort=True), "j: effort is True"),
        (lambda: Prismatic("j", velocity=float("nan")), "j: velocity is nan"),
        (lambda: Free("j", velocity=1), "j: velocity is given, but a Free joint has not one"),
    ],
)
def test_ranges_that_are_refused(joint, message):
    with pytest.raises(DescriptionError, match=message):
        joint()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (dict(speed={"j3": 1.0}), "speed has 'j3'"),
        (dict(effort={"j2": 1.0}), "effort has 'j2', which has no motor"),
        (dict(effort={"j1": 0.0}), "effort of 'j1' is 0.0; give a number above zero"),
        (dict(speed={"j1": "fast"}), "speed of 'j1' is 'fast'"),
        (dict(speed=[1.0, 2.0]), "speed is .1.0, 2.0.; give a mapping from names"),
        (dict(speed={"j1": np.nan}), "speed of 'j1' is nan"),
        (dict(effort={"j1": True}), "effort of 'j1' is True"),
    ],
)
def test_what_is_refused(system, given, message):
    with pytest.raises(ModelError, match=message):
        limits(system, **given)
