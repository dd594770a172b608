"""Named scalars of a Function found in an equal one."""

import casadi
import numpy as np
from casadi import SX, Function
from support.catalogue_systems import catalogue_system

import mbs
import mbs.models
from mbs.operations import count, simplify
from mbs.operations.pipeline import names_found


def functions(between, result, other):
    """A Function with named scalars, and one that computes the same by other operations."""
    x = SX.sym("x", 2)
    named = [value(x) for value in between.values()]
    one = Function("f", [x], [result(x), *named], ["x"], ["y", *between])
    return Function("f", [x], [other(x)], ["x"], ["y"]), one


def test_equal_and_opposite_scalars_are_found_and_others_are_not():
    plain, named = functions(
        {
            "S": lambda x: x[0] + x[1],
            "D": lambda x: x[1] - x[0],
            "gone": lambda x: x[0] * x[0],
            "constant": lambda x: SX(2),
            "input": lambda x: x[0],
        },
        lambda x: x[0] * x[0] - x[1] * x[1],
        lambda x: (x[0] + x[1]) * (x[0] - x[1]),
    )
    found = names_found(plain, named)
    assert found.name_out() == ["y", "S", "D"]
    assert [float(value) for value in found([5, 3])] == [16, 8, -2]
    assert count(found) == count(plain)


def test_two_names_of_one_scalar_are_both_found():
    plain, named = functions(
        {"A": lambda x: x[0] * x[1], "B": lambda x: x[1] * x[0]},
        lambda x: casadi.sin(x[0] * x[1]),
        lambda x: casadi.sin(x[1] * x[0]),
    )
    assert names_found(plain, named).name_out() == ["y", "A", "B"]


def test_a_simplified_model_has_the_values_of_its_names():
    idm = mbs.models.inverse_dynamics(catalogue_system("rx90"))
    small, named = simplify(idm), idm.annotated()
    found = small.annotated()
    assert 90 < found.n_out() < named.n_out()
    assert count(found) == count(small)
    assert "W12" in found.name_out()
    point = [np.random.default_rng(1).uniform(-1, 1, idm.numel_in(k)) for k in range(3)]
    wanted = dict(zip(named.name_out(), named(*point), strict=True))
    for name, value in zip(found.name_out(), found(*point), strict=True):
        np.testing.assert_allclose(value, wanted[name], rtol=1e-9, atol=1e-9)
