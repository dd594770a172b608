"""Count the operations of a Function, in the convention of the literature.

Source: the convention of Khalil & Kleinfinger 1987: multiplications and additions are counted,
sign changes are not. Operations on constant parameters alone are counted separately.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import casadi
from casadi import Function

from mbs.operations.graph import Graph, graph_of

_DIVISION = 2
"""Cost of a division in multiplications."""
_MUL = {casadi.OP_MUL, casadi.OP_SQ}
_ADD = {casadi.OP_ADD, casadi.OP_SUB, casadi.OP_TWICE}
_DIV = {casadi.OP_DIV, casadi.OP_INV}
_TRIG = {
    *(casadi.OP_SIN, casadi.OP_COS, casadi.OP_TAN),
    *(casadi.OP_ASIN, casadi.OP_ACOS, casadi.OP_ATAN, casadi.OP_ATAN2),
}
_KINDS = ("mul", "add", "div", "sqrt", "trig", "other")
_FREE = {casadi.OP_INPUT, casadi.OP_CONST, casadi.OP_NEG, casadi.OP_ASSIGN}
_KIND = {
    **dict.fromkeys(_FREE, ""),
    **dict.fromkeys(_ADD, "add"),
    **dict.fromkeys(_DIV, "div"),
    **dict.fromkeys(_TRIG, "trig"),
    casadi.OP_SQRT: "sqrt",
}


@dataclass(frozen=True, slots=True)
class Count:
    """Numbers of operations.

    Attributes:
        mul: multiplications, including squares.
        add: additions and subtractions; 2 x counts as x + x.
        div: divisions.
        sqrt: square roots.
        trig: evaluations of sines, cosines and other trigonometric functions.
        other: other operations, such as tanh, powers and comparisons.
        parameter_only: operations on constants and parameters alone. They are done once and are
            not included in the numbers above.
    """

    mul: int = 0
    add: int = 0
    div: int = 0
    sqrt: int = 0
    trig: int = 0
    other: int = 0
    parameter_only: Count | None = field(default=None, compare=False)

    @property
    def total(self) -> int:
        """Number of all operations, each counted once."""
        return self.mul + self.add + self.div + self.sqrt + self.trig + self.other

    @property
    def price(self) -> int:
        """Cost for the choice between equal forms: mul + add + 2 div.

        Equal forms have the same sines, cosines and roots.
        """
        return self.mul + self.add + _DIVISION * self.div

    def __str__(self) -> str:
        """Return "multiplications/additions", as in the literature; divisions count as mul."""
        return f"{self.mul + self.div}/{self.add}"


def count(function: Function, parameters: Iterable[str] = ("p",)) -> Count:
    """Count the operations of a Function. Nodes that no output needs are not counted.

    A product by -1 or 1 is free and a product by 2 is an addition, as in handwritten code.

    Args:
        function: Function of scalar operations, or a Function that can be expanded to them.
        parameters: names of inputs that are constant from call to call. Unknown names are ignored.

    Returns:
        the numbers of operations; `str` of them is "multiplications/additions".

    Raises:
        ModelError: the Function has no scalar operations.
    """
    return count_graph(graph_of(function), parameters)


def cheapest(*models: Function) -> Function:
    """Return the first Function with the lowest `Count.price` among equal Functions.

    Args:
        models: one or more Functions with equal values.
    """
    return models[0] if len(models) == 1 else min(models, key=lambda model: count(model).price)


def count_graph(graph: Graph, parameters: Iterable[str] = ("p",)) -> Count:
    """Return the numbers of operations of a graph; nodes that no output needs are not counted.

    Args:
        graph: scalar operations of a Function.
        parameters: names of inputs that are constant from call to call; see `count`.
    """
    alive, fixed = graph.live(), graph.fixed_by(parameters)
    changing: Counter[str] = Counter()
    once: Counter[str] = Counter()
    for number in range(len(graph.nodes)):
        kind = _kind(graph, number)
        if alive[number] and kind:
            tally = once if fixed[number] else changing
            tally[kind] += 1
    return replace(_numbers(changing), parameter_only=_numbers(once))


def _numbers(tally: Counter[str]) -> Count:
    """Return the numbers of operations by kind as a Count, without `parameter_only`."""
    return Count(**{kind: tally[kind] for kind in _KINDS}, parameter_only=None)


def _kind(graph: Graph, number: int) -> str:
    """Return the field of Count ("mul", "add", ...) for the operation of node `number`.

    Empty if the operation is free: inputs, constants, signs and assignments.
    """
    op = graph.nodes[number].op
    return _kind_of_product(graph, number) if op in _MUL else _KIND.get(op, "other")


def _kind_of_product(graph: Graph, number: int) -> str:
    """Return the field of Count for the product node `number`.

    "" for a factor of 1 or -1, "add" for 2 or -2, else "mul".
    """
    operands = (graph.nodes[operand] for operand in graph.operands(number))
    factor = {abs(node.value) for node in operands if node.op == casadi.OP_CONST}
    if factor == {1.0}:
        return ""
    return "add" if factor == {2.0} else "mul"
