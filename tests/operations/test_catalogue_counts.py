"""Upper bounds of the operations of robots; a better recursion or pass may lower them."""

import pytest
from operations.expressions import require_equal
from support.catalogue_systems import catalogue_system
from symbolic_robots import symbolic_robot

import mbs
from mbs.operations import count, simplify, split


def test_the_jacobian_of_the_rx90():
    f = mbs.models.jacobian(symbolic_robot("rx90", "none").assemble(), 6)
    simple = simplify(f)
    found = count(simple)
    assert found.mul <= 30
    assert found.add <= 10
    assert found.trig <= count(f).trig
    require_equal(f, simple)


@pytest.mark.sweep
@pytest.mark.parametrize(
    ("robot", "model", "most"),
    [
        ("puma560", "inverse_dynamics", 335),
        ("puma560", "inertia_matrix", 150),
        ("rx90", "inverse_dynamics", 345),
        ("rx90", "inertia_matrix", 120),
        ("stanford", "inverse_dynamics", 234),
        ("stanford", "direct_dynamics", 385),
        ("sr400", "inverse_dynamics", 520),
        ("sr400", "inertia_matrix", 215),
    ],
)
def test_catalogue(robot, model, most):
    f = getattr(mbs.models, model)(catalogue_system(robot))
    simple = simplify(f)
    assert count(simple).total <= min(most, count(f).total)
    require_equal(f, simple, -1.0, 1.0)
    parts = split(simple)
    assert count(parts.main, ()).total == count(simple).total


@pytest.mark.parametrize("robot", ["puma560", "stanford"])
def test_what_is_simple_stays_as_it_is(robot):
    f = simplify(mbs.models.inverse_dynamics(catalogue_system(robot)))
    assert count(simplify(f)) == count(f)
