"""One operation of a graph as a C expression, of numbers and of vectors."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import casadi

from mbs.errors import ModelError
from mbs.operations.graph import Graph, Node
from mbs.operations.text import CODES, NAMES

_OF_TWO = ("fmod", "remainder", "copysign", "fmin", "fmax", "atan2", "hypot")
_OF_ONE = (
    *("exp", "log", "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "floor", "ceil"),
    *("fabs", "erf", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "log1p", "expm1"),
)
BINARY: Mapping[int, str] = {
    casadi.OP_ADD: "{} + {}",
    casadi.OP_SUB: "{} - {}",
    casadi.OP_MUL: "{} * {}",
    casadi.OP_DIV: "{} / {}",
    casadi.OP_LT: "{} < {}",
    casadi.OP_LE: "{} <= {}",
    casadi.OP_EQ: "{} == {}",
    casadi.OP_NE: "{} != {}",
    casadi.OP_AND: "{} && {}",
    casadi.OP_OR: "{} || {}",
    casadi.OP_IF_ELSE_ZERO: "{} ? {} : 0.0",
    casadi.OP_POW: "pow({}, {})",
    casadi.OP_CONSTPOW: "pow({}, {})",
    **{CODES[name]: f"{name}({{}}, {{}})" for name in _OF_TWO},
}
"""C text of the operations of two numbers, by CasADi's codes."""

_UNARY: Mapping[int, str] = {
    casadi.OP_ASSIGN: "{0}",
    casadi.OP_NEG: "-{0}",
    casadi.OP_SQ: "{0} * {0}",
    casadi.OP_TWICE: "{0} + {0}",
    casadi.OP_INV: "1.0 / {0}",
    casadi.OP_NOT: "!{0}",
    casadi.OP_SIGN: "({0} > 0.0 ? 1.0 : {0} < 0.0 ? -1.0 : {0})",
    **{CODES[name]: f"{name}({{0}})" for name in _OF_ONE},
}


ELEMENTWISE = frozenset((*BINARY, *_UNARY))
"""CasADi's codes of the operations that C has."""

_SIGNS_OF_VECTORS = ("add", "sub", "mul", "div", "assign", "neg", "sq", "twice", "inv")
_IN_EACH_LANE = ("erf", "asinh", "acosh", "atanh", "log1p")
VECTORS: Mapping[int, str] = {
    **{
        op: f"mbs_each_{NAMES[op]}" if NAMES[op] in _IN_EACH_LANE else f"mbs_{NAMES[op]}"
        for op in ELEMENTWISE - {CODES[name] for name in (*_SIGNS_OF_VECTORS, "sin", "cos")}
    },
    casadi.OP_CONSTPOW: "mbs_pow",
}
"""Of every operation on vectors that has no sign in C, the function in elementary.h; sines and
cosines of one angle are made together."""


def expression(
    graph: Graph, number: int, written: Callable[[Graph, int], str] | None = None
) -> str:
    """The C expression of a node.

    Args:
        graph: has it.
        number: of the node.
        written: gives the text of an operand; `operand` unless told.

    Raises:
        ModelError: the operation has no equivalent in C's library.
    """
    write = written or operand
    return form_of(graph, number).format(*(write(graph, n) for n in graph.operands(number)))


def form_of(graph: Graph, number: int) -> str:
    """The C expression of a node with places for its operands, as `str.format` takes it.

    Args:
        graph: has it.
        number: of the node.

    Raises:
        ModelError: the operation has no equivalent in C's library.
    """
    op = graph.nodes[number].op
    form = BINARY.get(op) or _UNARY.get(op)
    if form is None:
        raise ModelError(
            f"{graph.name}: operation {op} of CasADi has no C equivalent; compile without fast"
        )
    return form


def operand(graph: Graph, number: int) -> str:
    """A node as it is written inside an expression: input, constant or name of its value."""
    node = graph.nodes[number]
    if node.op == casadi.OP_INPUT:
        return f"i{node.args[0]}[{node.args[1]}]"
    return constant(node) if node.op == casadi.OP_CONST else f"t{number}"


def constant(node: Node) -> str:
    """A constant that C reads back to the last bit."""
    if math.isnan(node.value):
        return "NAN"
    if math.isinf(node.value):
        return "INFINITY" if node.value > 0 else "(-INFINITY)"
    text = repr(node.value)
    return f"({text})" if text.startswith("-") else text
