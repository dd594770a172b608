"""Names of operations, and expressions as people write them."""

import casadi
import pytest
from casadi import SX, Function

from mbs.identification.grouping.grouping import equation
from mbs.native.c_code import ELEMENTWISE, VECTORS
from mbs.operations.graph import graph_of
from mbs.operations.text import CODES, NAMES, PRODUCT, SUM, Infix

x, y, z = (SX.sym(name) for name in "xyz")


def written(value, tightness=SUM):
    graph = graph_of(Function("f", [casadi.vertcat(x, y, z)], [value], ["p"], ["r"]))
    return Infix(graph, {"p": "xyz"}).text(graph.results[0][0], tightness)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ((x**y) ** z, "(x^y)^z"),
        (x ** (y**z), "x^(y^z)"),
        (x - (y - z), "x - (y - z)"),
        ((x - y) - z, "x - y - z"),
        (x / (y * z), "x/(y*z)"),
        (x / y * z, "x/y*z"),
        (-(x + y) * z, "-(x + y)*z"),
        (x * -3, "(-3)*x"),
        ((x + y) ** 2 / 4, "(x + y)^2/4"),
        (1 / (x + y), "1/(x + y)"),
        (casadi.atan2(x, y) + casadi.log1p(z), "atan2(x, y) + log1p(z)"),
        (casadi.if_else(x < y, z, 0), "(x < y)*z"),
    ],
)
def test_brackets_stand_where_they_are_needed(value, text):
    assert written(value) == text


def test_a_sum_in_a_product_is_bracketed():
    assert written(x + y, PRODUCT) == "(x + y)"
    assert written(x * y, PRODUCT) == "x*y"


def test_names_and_codes_are_each_others_inverse():
    assert {CODES[name]: name for name in NAMES.values()} == NAMES
    assert NAMES[casadi.OP_IF_ELSE_ZERO] == "if_else_zero"


def test_vectors_have_every_operation_that_has_no_sign():
    signs = ["add", "sub", "mul", "div", "assign", "neg", "sq", "twice", "inv", "sin", "cos"]
    assert set(VECTORS) == ELEMENTWISE - {CODES[name] for name in signs}
    assert VECTORS[casadi.OP_CONSTPOW] == VECTORS[casadi.OP_POW] == "mbs_pow"
    assert VECTORS[casadi.OP_ERF] == "mbs_each_erf"


def test_factors_of_grouped_parameters_have_absolute_values():
    assert equation("R", {"A": SX(1), "B": -casadi.fabs(x) * y}) == "R = A - abs(x)*y*B"
