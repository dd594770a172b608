"""Functions of arrays give what a call of CasADi gives, and refuse what it would misread."""

from concurrent.futures import ThreadPoolExecutor

import casadi
import numpy as np
import pytest
from casadi import SX, Function

from mbs.numbers import on_arrays

Q, P = SX.sym("q", 3), SX.sym("p", 2)
ROWS = casadi.sin(Q) * P[0] + Q[0]
FUNCTION = Function("rows", [Q, P], [ROWS, casadi.densify(casadi.jacobian(ROWS, Q)[:2, :])])


def test_values_and_order_of_elements_are_those_of_a_call():
    q, p = np.array([0.3, -0.7, 1.9]), np.array([2.5, 0.0])
    called = [value.full() for value in FUNCTION(q, p)]
    found = on_arrays(FUNCTION)(q[::-1][::-1], p.reshape(2, 1))  # whatever their memory looks like
    for one, other in zip(found, called, strict=True):
        np.testing.assert_array_equal(one, other)
        assert one.flags["C_CONTIGUOUS"]
        assert one.shape == other.shape


def test_each_call_has_memory_of_its_own():
    evaluated = on_arrays(FUNCTION)
    points = [np.full(3, 0.1 * k) for k in range(200)]
    with ThreadPoolExecutor(4) as workers:
        found = list(workers.map(lambda q: evaluated(q, np.ones(2))[0], points))
    for q, value in zip(points, found, strict=True):
        np.testing.assert_array_equal(value, FUNCTION(q, np.ones(2))[0].full())


def test_nothing_is_an_array_too():
    nothing = SX.sym("p", 0)
    evaluated = on_arrays(Function("f", [Q, nothing], [2 * Q, SX(0, 3)]))
    found = evaluated(np.ones(3), np.zeros(0))
    assert [value.shape for value in found] == [(3, 1), (0, 3)]
    np.testing.assert_array_equal(found[0], 2)


@pytest.mark.parametrize("q", [np.ones(2), np.ones(4), np.ones((3, 2))])
def test_arrays_of_another_size_are_refused(q):
    with pytest.raises(ValueError, match=r"rows takes arrays of \[3, 2\] elements"):
        on_arrays(FUNCTION)(q, np.ones(2))


def test_sparse_outputs_are_filled_with_zeros():
    pattern = casadi.jacobian(ROWS, Q)
    f = Function("f", [Q, P], [pattern, casadi.diag(Q)])
    q, p = np.array([0.3, -0.7, 1.9]), np.array([2.5, 0.0])
    assert not f.sparsity_out(1).is_dense()
    for one, other in zip(on_arrays(f)(q, p), f(q, p), strict=True):
        np.testing.assert_array_equal(one, other.full())
