"""Operations of Jacobians against the published figures, and what the choices are."""

import casadi
import numpy as np
import pytest
from casadi import SX
from symbolic_robots import symbolic_robot

import mbs.models
from mbs.models import jacobian
from mbs.operations import count
from mbs.recursions.jacobian import VelocityTarget, cheapest_jacobian, outlook
from mbs.recursions.jacobian import jacobian as frame_jacobian
from mbs.recursions.route import cost


@pytest.mark.parametrize(
    ("name", "most"), [("puma560", (32, 13)), ("rx90", (28, 9)), ("stanford", (26, 8))]
)
def test_operations_in_the_base_axes(name, most):
    found = count(jacobian(symbolic_robot(name, "none").assemble(), 6))
    assert (found.mul + found.div, found.add) <= most
    assert found.add <= most[1]


@pytest.mark.parametrize(
    ("name", "most"), [("puma560", (8, 4)), ("rx90", (6, 3)), ("stanford", (5, 0))]
)
def test_operations_in_the_intermediate_axes(name, most):
    system = symbolic_robot(name, "none").assemble()
    factors = jacobian(system, 6, form="renaud")
    q, p = SX.sym("q", 6), SX.sym("p", system.p.numel())
    _, _, J = factors(q, p)
    found = count(casadi.Function("J", [q, p], [J], ["q", "p"], ["J"]))
    assert found.mul <= most[0]
    assert found.add <= most[1]
    chosen = jacobian(system, 6, form="renaud", intermediate=3)
    explicit = casadi.Function("J", [q, p], [chosen(q, p)[2]], ["q", "p"], ["J"])
    assert count(explicit).mul == found.mul


def test_choice_is_the_least_of_all_ways():
    system = symbolic_robot("general_6r", "none").assemble()
    q = SX.sym("q", 6)
    target = VelocityTarget(system.tree, q, system.p, system.frame(6), system.frame("base"))
    seen = outlook(target)
    ways = [frame_jacobian(seen, matrices=m) for m in range(seen.rotations + 1)]
    every = [cost(J, q, system.p) for J in ways]
    best = cost(cheapest_jacobian(target), q, system.p)
    assert best <= min(every) + 2
    assert best < 0.8 * max(every)


@pytest.mark.sweep
@pytest.mark.parametrize("reference", [None, -1, 0, 2, 5])
@pytest.mark.parametrize("axes", [0, 3, 6])
def test_no_choice_changes_the_result(axes, reference):
    system = symbolic_robot("general_6r", "none").assemble()
    q = SX.sym("q", 6)
    target = VelocityTarget(system.tree, q, system.p, system.frame(6), system.frame(axes))
    seen = outlook(target)
    ways = [frame_jacobian(seen, reference, m) for m in (0, 3, seen.rotations)]
    f = casadi.Function("f", [q, system.p], ways)
    sample = np.linspace(-1, 2, 6), system.p_default
    first, *others = (np.array(J) for J in f(*sample))
    for other in others:
        np.testing.assert_allclose(other, first, rtol=0, atol=1e-13)
    whole = np.array(mbs.models.jacobian(system, 6, expressed_in=axes)(sample[0]))
    T = np.array(mbs.models.transform(system, 6, relative_to=axes)(sample[0]))
    if reference is not None:
        at = np.array(mbs.models.transform(system, reference + 1, relative_to=axes)(sample[0]))
        whole[:3] += np.cross(whole[3:].T, at[:3, 3] - T[:3, 3]).T
    np.testing.assert_allclose(first, whole, rtol=0, atol=1e-13)
