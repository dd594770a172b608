"""The price by which one of several ways is chosen."""

import casadi
from casadi import SX, Function

from mbs.operations import Count, count
from mbs.recursions.route import cost


def test_a_division_is_two_multiplications():
    assert Count(mul=3, add=4, div=5).price == 3 + 4 + 2 * 5


def test_sines_and_roots_have_no_price():
    assert Count(mul=1, trig=7, sqrt=2, other=3).price == 1


def test_price_of_a_function_and_of_a_matrix():
    q, p = SX.sym("q", 2), SX.sym("p")
    value = casadi.vertcat(q[0] / q[1] + casadi.sin(q[0]) * p, p * p)
    assert count(Function("f", [q, p], [value], ["q", "p"], ["o"])).price == 2 + 1 + 1
    assert cost(value, q, p) == 4
