import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.measured_arm import arm

import mbs
from mbs.components import Body, Spherical
from mbs.errors import ModelError
from mbs.identification.leading import active_indices, is_explicit, positions


def test_open_systems_are_their_own_configuration():
    q = np.random.default_rng(1).normal(size=(4, 3))
    assert positions(arm(), q) is q
    assert active_indices(arm()) == [0, 1, 2]
    assert is_explicit(arm())


def test_angles_that_follow_do_not_jump():
    system = catalogue_system("sr400")
    places = active_indices(system)
    swing = np.linspace(-0.6, 0.6, 121)
    rates = np.array([1, 1, 1, 1, 1, -0.5])
    q_a = np.array([system.configuration[k] for k in places]) + np.outer(swing, rates)
    configurations = positions(system, q_a)
    assert configurations[:, places] == pytest.approx(q_a, abs=1e-12)
    assert configurations[60] == pytest.approx(np.array(system.configuration), abs=1e-9)
    assert np.abs(np.diff(configurations, axis=0)).max() < 0.05
    assert configurations[:, 2].max() > np.pi > configurations[:, 2].min()


def test_a_platform_is_followed_from_its_arms():
    system = catalogue_system("delta")
    assert not is_explicit(system)
    configurations = positions(system, np.array([[0.0, 0.0, 0.0], [0.2, 0.2, 0.2]]))
    assert configurations[0] == pytest.approx(np.array(system.configuration), abs=1e-9)
    assert configurations[1, 2] < configurations[0, 2] - 0.02
    assert configurations[1, :2] == pytest.approx([0, 0], abs=1e-9)


def test_a_ball_is_no_independent_position():
    m = mbs.Mechanism("ball")
    m.connect(m.world, Spherical("j"), m.add(Body("b", mass=1, inertia=(1, 1, 1))))
    with pytest.raises(ModelError, match="j is a quaternion, whose position is not the integral"):
        active_indices(m.assemble())
