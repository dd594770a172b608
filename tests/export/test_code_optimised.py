"""Text of simplified models: names of the quantities that they still compute."""

import ast
import re

import numpy as np
import pytest
from casadi import SX, Function
from export.code_text import idm, lines

import mbs
from mbs.export.languages.build import negate_nodes
from mbs.operations import count, simplify
from mbs.operations.graph import function_of, graph_of


def operations(text: str) -> int:
    """Operations between two scalars in a Python text; signs are none."""
    ways = (ast.Add, ast.Sub, ast.Mult, ast.Div)
    found = (node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.BinOp))
    return sum(isinstance(node.op, ways) for node in found)


@pytest.mark.parametrize("name", ["rx90", "sr400", "four_bar"])
def test_names_cost_no_operation_and_change_no_value(name):
    model = simplify(idm(name))
    text, bare = mbs.export.code(model, "python"), mbs.export.code(Function(model), "python")
    assert operations(text) == operations(bare)
    scope: dict = {}
    exec(text, scope)
    random = np.random.default_rng(3)
    point = [random.uniform(-1, 1, model.numel_in(k)) for k in range(model.n_in())]
    expected = np.array(Function.call(model, point)[0]).ravel()
    got = np.ravel(scope[model.name()](*point))
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_most_lines_bear_names_of_the_notation():
    model = simplify(idm("rx90"))
    named, bare = (lines(mbs.export.code(f, "c")) for f in (model, Function(model)))
    free = [sum(bool(re.fullmatch(r"Z\d+", name)) for name in text) for text in (named, bare)]
    assert free[0] < free[1] / 2
    assert {"W12", "WP33", "W26", "F13"} < named.keys()
    assert "W12" not in bare


@pytest.mark.parametrize(
    ("value", "opposite"),
    [
        (lambda x: x[0] - x[1], "x2 - x1"),
        (lambda x: x[0] + x[1], "-x1 - x2"),
        (lambda x: x[0] * x[1], "-x1*x2"),
        (lambda x: x[0] / x[1], "-x1/x2"),
        (lambda x: 2 * x[0], "-2*x1"),
    ],
)
def test_a_scalar_is_computed_with_the_sign_of_its_name(value, opposite):
    x = SX.sym("x", 2)
    scalar = value(x)
    y = (scalar + 3) * scalar
    function = Function("f", [x], [y], ["x"], ["y"])
    graph = graph_of(function)
    number = next(n for n in range(len(graph.nodes)) if graph.operands(n))
    other, _ = negate_nodes(graph, [number])
    made = function_of(other)
    assert float(made([0.3, 0.7])) == pytest.approx(float(function([0.3, 0.7])), rel=1e-15)
    assert count(made) == count(function)

    class Named(Function):
        def annotated(self):
            return Function("f", [x], [y, -scalar], ["x"], ["y", "W"])

    text = mbs.export.code(Named(function), "python")
    assert f"W = {opposite}\n" in text
    assert re.search(r"y = -W\*\(3 - W\)|y = -\(3 - W\)\*W", text)
