"""The adapters of benchmarks/inverse_geometry.py: what they answer reaches the pose."""

import numpy as np
import pytest
from inverse_geometry_cases import CASES
from inverse_geometry_peers import _common_perpendicular, _screw_x, _screw_z, _standard
from support import arms
from support.arm_search import plain_arm
from support.catalogue_systems import catalogue_system

ARMS = {
    "puma560": lambda: catalogue_system("puma560"),
    "ur5": lambda: catalogue_system("ur5"),
    "general": lambda: arms.general_6r(3),
}


def product(table, q):
    T = np.eye(4)
    for (a, d, alpha, theta), angle in zip(table, q, strict=True):
        T = T @ _screw_z(theta + angle, d) @ _screw_x(alpha, a)
    return T


@pytest.mark.parametrize("name", ARMS)
def test_standard_parameters_give_the_same_pose(name):
    arm = plain_arm(ARMS[name]())
    table, before, behind = _standard(arm)
    q = arm.random(np.random.default_rng(0))
    expected = before @ arm.pose(q) @ behind
    np.testing.assert_allclose(product(table, q), expected, atol=1e-12)


@pytest.mark.parametrize("alpha", [0.0, np.pi, -1.1, 0.4])
def test_common_perpendicular(alpha):
    T = _screw_z(0.3, 0.2) @ _screw_x(alpha, -0.4) @ _screw_z(1.2, 0.5)
    gamma, b, twist, d, theta, r = _common_perpendicular(T)
    found = _screw_z(gamma, b) @ _screw_x(twist, d) @ _screw_z(theta, r)
    np.testing.assert_allclose(found, T, atol=1e-12)


@pytest.mark.parametrize("name", ["puma560", "ur5"])
@pytest.mark.parametrize("who", ["Eaik", "Ikdh", "Ssik"])
def test_adapter(who, name):
    pytest.importorskip(who.lower())
    import inverse_geometry_peers

    arm = plain_arm(ARMS[name]())
    q = arm.random(np.random.default_rng(1))
    T = arm.pose(q)
    found, sure = getattr(inverse_geometry_peers, who)(arm).solve(T)
    assert len(found) >= 4
    assert np.all(arm.residual(T, found[sure]) < 1e-8)


@pytest.mark.parametrize(
    "name", ["general 6R", "6 joints with 2 sliding", "general 7R with a lock"]
)
def test_cases_are_reproducible(name):
    case = CASES[name]
    first, second = (case.build(1) for _ in range(2))
    assert first[1] == second[1]
    one, two = (plain_arm(*built) for built in (first, second))
    np.testing.assert_array_equal(one.gaps, two.gaps)
    T, known = case.pose(first[0], one, np.random.default_rng(0))
    assert one.residual(T, known).max() < 1e-12
    assert len(one.slides) == 6
