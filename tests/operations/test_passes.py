import casadi
import pytest
from casadi import SX
from operations.expressions import counted, function, passed, require_equal, sincos

from mbs.operations import count
from mbs.operations.graph import Node, drop, function_of, graph_of
from mbs.operations.passes import (
    angles,
    factor,
    fold,
    order,
    parameters,
    pythagoras,
    share,
    waiting,
)


@pytest.mark.parametrize(
    ("names", "outputs", "operations"),
    [
        ("a b", lambda a, b: ((a - b) * (b - a), b - a), "1/1"),
        ("a b", lambda a, b: casadi.sin(a - b) + casadi.sin(b - a), "0/0"),
        ("a b", lambda a, b: (casadi.cos(a - b), casadi.cos(b - a)), "0/1"),
        ("a b", lambda a, b: a / 4 + b / 4, "2/1"),
        ("a b", lambda a, b: ((a + b) - b, (a - b) + b, a - (a - b)), "0/0"),
        ("a b", lambda a, b: casadi.tanh(-a * b) * casadi.tanh(a * b), "2/0"),
        (
            "a b c",
            lambda a, b, c: casadi.if_else(a > b, -c, 0) + casadi.if_else(a > b, c, 0),
            "0/0",
        ),
    ],
)
def test_fold(names, outputs, operations):
    assert counted(passed(fold, function(names, outputs)))[0] == operations


def test_fold_computes_what_simplification_on_the_fly_left():
    casadi.GlobalOptions.setSimplificationOnTheFly(False)
    try:
        f = function("x", lambda x: SX(2) * SX(3) * x + SX(0) * x + casadi.sin(SX(0.5)) * SX(1))
    finally:
        casadi.GlobalOptions.setSimplificationOnTheFly(True)
    graph = fold(graph_of(f))
    assert [node.value for node in graph.nodes if node.op == casadi.OP_CONST] == pytest.approx(
        [6.0, 0.479425538604203]
    )
    require_equal(f, function_of(graph))


def test_a_result_that_is_no_finite_number_is_not_folded():
    f = casadi.Function("f", [SX.sym("x")], [SX(0.0)])
    zero = Node(casadi.OP_CONST, (), 0.0)
    graph = graph_of(f).with_nodes([zero, Node(casadi.OP_INV, (0,))], [[1]])
    assert [node.op for node in fold(graph).nodes] == [casadi.OP_CONST, casadi.OP_INV]


def test_drop_leaves_what_outputs_need():
    graph = graph_of(function("a b", lambda a, b: (a * b, a + b)))
    graph = graph.with_nodes(graph.nodes, [graph.results[0], graph.results[0]])
    assert len(drop(graph).nodes) == len(graph.nodes) - 1


@pytest.mark.parametrize(
    ("names", "outputs", "before", "after"),
    [
        ("p2 x", lambda p, x: p[0] * (x * p[1]), "2/0", "1/0"),
        ("p2 x y", lambda p, x, y: p[0] * (x * p[1] * y), "3/0", "2/0"),
        ("p2 x", lambda p, x: p[0] * x + p[1] * x, "2/1", "1/0"),
        ("p2 x", lambda p, x: (p[0] + x) + p[1], "0/2", "0/1"),
        ("p3 x y", lambda p, x, y: p[0] * (p[1] * x + p[2] * y), "3/1", "2/1"),
        ("p2 x y", lambda p, x, y: p[0] * (x + y), "1/1", "1/1"),
        ("p x y", lambda p, x, y: x / p + y / p + x * y, "3/2", "3/2"),
        ("p2 x y", lambda p, x, y: (p[0] * (p[1] * x), y * (p[1] * x)), "3/0", "3/0"),
        ("p2 x y", lambda p, x, y: (p[0] * (x + y) - p[1] * (x + y), x + y), "2/2", "1/1"),
    ],
)
def test_parameters(names, outputs, before, after):
    f = function(names, outputs)
    assert str(count(f)) == before
    assert str(count(passed(parameters, f))) == after


@pytest.mark.parametrize(
    ("names", "outputs", "after"),
    [
        ("a b c", lambda a, b, c: a * b + a * c, "1/1"),
        ("a b c", lambda a, b, c: a * b - c * a + a, "1/2"),
        ("a b c d", lambda a, b, c, d: a * b + a * c + d * b + d * c, "2/2"),
        ("p2 u", lambda p, u: p[0] * u + p[1] * u, "1/0"),
        ("p a b", lambda p, a, b: p * a + p * b, "1/1"),
        ("p a b", lambda p, a, b: p * a - p * b, "1/1"),
        ("a b c", lambda a, b, c: (a * b + a * c, a * b), "2/1"),
        ("a b c d", lambda a, b, c, d: a * b + c * d, "2/1"),
    ],
)
def test_factor(names, outputs, after):
    assert str(count(passed(factor, function(names, outputs)))) == after


@pytest.mark.parametrize(
    ("names", "outputs", "after"),
    [
        ("a b c d", lambda a, b, c, d: (a + (b + c), a + (c + d)), "0/3"),
        ("a b c d", lambda a, b, c, d: (a * (b * c), a * (c * d)), "3/0"),
        ("a b c d", lambda a, b, c, d: (a + b - c, c + d - a), "0/3"),
        ("a b c d", lambda a, b, c, d: ((a * b) * c, (c * d) * a, (a * c) * 3), "4/0"),
        ("a b c d", lambda a, b, c, d: ((a + b) + (c + d), (a + c) + (b + d)), "0/3"),
        ("p2 a b", lambda p, a, b: ((p[0] * a) * p[1], b * (p[0] * p[1])), "2/0"),
    ],
)
def test_share(names, outputs, after):
    assert str(count(passed(share, function(names, outputs)))) == after


def test_sharing_keeps_what_is_shared_already():
    def outputs(a, b, c, d, e):
        common = a + b + c
        return common * d, common * e, b + c

    f = function("a b c d e", outputs)
    assert str(count(passed(share, f))) == "2/2"


def _rotated(s, c, x, y):
    return c * x - s * y, s * x + c * y


@pytest.mark.parametrize(
    ("outputs", "after"),
    [
        (lambda u, v: u[1] * v[1] - u[0] * v[0], ("0/1", 1)),
        (lambda u, v: u[1] * v[1] + u[0] * v[0], ("0/1", 1)),
        (lambda u, v: (u[0] * v[1] - u[1] * v[0], u[1] * v[1] + u[0] * v[0]), ("0/1", 2)),
        (lambda u, v: 3 * u[0] * v[1] + v[0] * u[1] * 3, ("1/1", 1)),
        (lambda u, v: u[1] * v[1] - 2 * u[0] * v[0], ("2/2", 4)),
        (lambda u, v: u[1] * v[0], ("1/0", 2)),
    ],
)
def test_angles(outputs, after):
    f = function("q r", lambda q, r: outputs(sincos(q), sincos(r)))
    assert counted(passed(angles, f)) == after


def test_vectors_turned_twice_are_turned_once():
    def outputs(q, r, x, y):
        return tuple(_rotated(*sincos(q), *_rotated(*sincos(r), x, y)))

    f = function("q r x y", outputs)
    assert counted(f) == ("8/4", 4)
    assert counted(passed(angles, f)) == ("4/3", 2)


def test_angles_that_are_no_cheaper_stay_apart():
    def outputs(q, r, x, y):
        between = _rotated(*sincos(r), x, y)
        return (*between, *_rotated(*sincos(q), *between))

    f = function("q r x y", outputs)
    assert counted(passed(angles, f)) == counted(f) == ("8/4", 4)


@pytest.mark.parametrize(
    ("names", "outputs", "after"),
    [
        ("q x", lambda s, c, x: s * s * x + c * c * x, "0/0"),
        ("q x", lambda s, c, x: (s * x) * s + c * (x * c), "0/0"),
        ("q x", lambda s, c, x: (c * c * x, x - s * s * x), "2/0"),
        ("q p2", lambda s, c, p: p[0] * s * s + p[1] * c * c, "2/1"),
        ("q x y", lambda s, c, x, y: s * s * x + c * c * y, "4/1"),
    ],
)
def test_pythagoras(names, outputs, after):
    f = function(names, lambda q, *others: outputs(*sincos(q), *others))
    assert str(count(passed(pythagoras, f))) == after


def test_a_vector_turned_to_and_fro_is_itself():
    def outputs(q, x, y):
        s, c = sincos(q)
        return tuple(_rotated(-s, c, *_rotated(s, c, x, y)))

    assert counted(passed(pythagoras, function("q x y", outputs))) == ("0/0", 0)


def test_order_lets_fewer_values_wait():
    f = function("x8", lambda x: x[0] + (x[1] * x[2] + (x[3] * x[4] + (x[5] * x[6] + x[7]))))
    ordered = order(graph_of(f))
    assert (waiting(graph_of(f)), waiting(ordered)) == (3, 2)
    require_equal(f, function_of(ordered))
    assert f.sz_w() > function_of(ordered).sz_w()
