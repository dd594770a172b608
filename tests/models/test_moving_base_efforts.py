"""Gravity efforts and nonlinear effects on a moving base, against inverse dynamics and by hand."""

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.components import Body, Revolute
from mbs.models import bias, gravity_effort, inverse_dynamics

CASES = [  # an open tree and two closed mechanisms
    ("two_branch_tree", "independent"),
    ("four_bar", "independent"),
    ("four_bar", "tree"),
    ("sr400", "independent"),
    ("sr400", "tree"),
]
STILL = np.zeros(6)


@pytest.fixture(params=CASES, ids=lambda case: " ".join(case))
def case(request):
    """A system, its coordinates, a closed configuration and a generator of random numbers."""
    name, coordinates = request.param
    system = catalogue_system(name)
    rng = np.random.default_rng(20261128)
    q = system.configuration if system.is_closed else rng.uniform(-1, 1, system.nq)
    return system, coordinates, np.array(q), rng


def orientation(rng):
    """A random rotation matrix."""
    R, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    return R * np.linalg.det(R)


def numbers(value):
    return np.array(value).ravel()


def test_gravity_effort_is_inverse_dynamics_at_rest(case):
    system, coordinates, q, rng = case
    model = gravity_effort(system, coordinates, moving_base=True)
    assert model.name_in() == ["q", "R_0"]
    assert model.size_in("R_0") == (3, 3)
    R_0, rest = orientation(rng), np.zeros(model.size1_out(0))
    Q = numbers(model(q, R_0))
    idm = inverse_dynamics(system, coordinates, moving_base=True)
    tau = numbers(idm(q, rest, rest, STILL, STILL, R_0))
    np.testing.assert_allclose(Q, tau, rtol=0, atol=1e-12 * np.abs(tau).max())
    fixed = numbers(gravity_effort(system, coordinates)(q))
    np.testing.assert_allclose(numbers(model(q, np.eye(3))), fixed, rtol=0, atol=1e-12)
    assert np.abs(Q - fixed).max() > 0.1  # the orientation matters


def test_bias_is_inverse_dynamics_without_joint_accelerations(case):
    system, coordinates, q, rng = case
    model = bias(system, coordinates, moving_base=True)
    assert model.name_in()[2:] == ["v_0", "a_0", "R_0"]
    assert [model.size_in(k) for k in range(2, 5)] == [(6, 1), (6, 1), (3, 3)]
    v = rng.uniform(-1, 1, model.size1_out(0))
    base = (*rng.uniform(-1, 1, (2, 6)), orientation(rng))
    H = numbers(model(q, v, *base))
    tau = numbers(inverse_dynamics(system, coordinates, moving_base=True)(q, v, 0 * v, *base))
    np.testing.assert_allclose(H, tau, rtol=0, atol=1e-12 * np.abs(tau).max())
    fixed = numbers(bias(system, coordinates)(q, v))
    np.testing.assert_allclose(
        numbers(model(q, v, STILL, STILL, np.eye(3))), fixed, rtol=0, atol=1e-12
    )
    assert np.abs(H - fixed).max() > 0.1


def test_a_pendulum_on_a_moving_base_by_hand():
    """Mass 2 kg at 0.5 m from the joint, 0.3 kg m2 about its centre; gravity along -y."""
    m = mbs.Mechanism("pendulum", gravity=(0, -9.81, 0))
    bar = m.add(Body("bar", mass=2.0, com=(0.5, 0, 0), inertia=(0.1, 0.2, 0.3)))
    m.connect(m.world, Revolute("j", axis="z"), bar)
    system = m.assemble()
    q, tilt, turn, rise = 0.4, 0.7, 1.1, 0.6
    R_0 = [[np.cos(tilt), -np.sin(tilt), 0], [np.sin(tilt), np.cos(tilt), 0], [0, 0, 1]]
    weight = 2.0 * 9.81 * 0.5 * np.cos(q + tilt)
    assert float(gravity_effort(system, moving_base=True)(q, R_0)) == pytest.approx(
        weight, rel=1e-13
    )
    # the base accelerates along its own y axis and about z: m r rise cos(q) + (I + m r^2) turn
    a_0 = [0, rise, 0, 0, 0, turn]
    H = float(bias(system, moving_base=True)(q, 0.9, np.zeros(6), a_0, R_0))
    more = 2.0 * 0.5 * rise * np.cos(q) + (0.3 + 2.0 * 0.5**2) * turn
    assert pytest.approx(weight + more, rel=1e-13) == H
