"""What a survey of a Jacobian finds does not depend on the size of the mechanism."""

import numpy as np
import pytest
from casadi import SX

import mbs
import mbs.models
from mbs.models import singularities
from mbs.recursions.jacobian import VelocityTarget, nonzero, survey, varying


def arm(size):
    """A planar arm of two links and a twisted wrist, in units of `size`."""
    rows = [
        {"antecedent": 0, "joint": "revolute"},
        {"antecedent": 1, "joint": "revolute", "d": 0.5 * size},
        {"antecedent": 2, "joint": "revolute", "d": 0.4 * size, "alpha": np.pi / 2},
        {"antecedent": 3, "joint": "revolute", "r": 0.001 * size, "alpha": 0.3},
    ]
    bodies = [{"frame": k + 1, "M": 1.0} for k in range(4)]
    return mbs.load({"name": "arm", "frame": rows, "body": bodies}).assemble()


def surveyed(size):
    system = arm(size)
    q = SX.sym("q", system.nq)
    return survey(VelocityTarget(system.tree, q, system.p, system.frame(4), system.frame("base")))


@pytest.mark.parametrize("size", [1e-12, 1e-6, 1e6])
def test_zeros_and_origins_are_those_of_the_usual_size(size):
    usual, other = surveyed(1.0), surveyed(size)
    assert other.separate_origins() == usual.separate_origins() == [1, 2, 3]
    for found in (nonzero, varying):
        np.testing.assert_array_equal(found(other.J), found(usual.J))
    np.testing.assert_allclose(other.p, usual.p, atol=1e-14)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e6])
def test_singularities_of_an_arm_of_any_size(size):
    found = singularities(arm(size), 3, rows=["Vx", "Vy"], columns=[0, 1])
    assert [factor.text for factor in found.factors] == ["S2"]
    assert float(found.constant) == pytest.approx(0.2 * size**2)


def test_velocities_that_are_made_of_others():
    usual = surveyed(1.0)
    G = np.random.default_rng(0).standard_normal((3, 4, 2))
    small = usual.combine(1e-13 * G)
    np.testing.assert_array_equal(nonzero(small.J), nonzero(usual.J @ G))
    idle = np.zeros((3, 4, 1))
    assert not nonzero(usual.combine(idle).J).any()
