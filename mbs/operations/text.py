"""Names of CasADi's operations, and graphs as infix expressions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi

from mbs.operations.graph import Graph, Node

NAMES: Mapping[int, str] = {
    code: name.removeprefix("OP_").lower()
    for name, code in vars(casadi).items()
    if name.startswith("OP_")
}
"""Names of CasADi's operations by code. Functions have the same names as in the C library."""

CODES: Mapping[str, int] = {name: code for code, name in NAMES.items()}
"""CasADi's operation codes by name."""

SUM, NEGATIVE, PRODUCT, POWER, ATOM = range(5)
"""Binding strengths of the outermost operator of a text, from weak to strong."""

_SIGNS: Mapping[int, tuple[str, int, tuple[int, ...]]] = {
    casadi.OP_ADD: ("{} + {}", SUM, (SUM, SUM)),
    casadi.OP_SUB: ("{} - {}", SUM, (SUM, PRODUCT)),
    casadi.OP_NEG: ("-{}", NEGATIVE, (PRODUCT,)),
    casadi.OP_MUL: ("{}*{}", PRODUCT, (PRODUCT, PRODUCT)),
    casadi.OP_TWICE: ("2*{}", PRODUCT, (PRODUCT,)),
    casadi.OP_DIV: ("{}/{}", PRODUCT, (PRODUCT, POWER)),
    casadi.OP_INV: ("1/{}", PRODUCT, (POWER,)),
    casadi.OP_SQ: ("{}^2", POWER, (ATOM,)),
    casadi.OP_POW: ("{}^{}", POWER, (ATOM, ATOM)),
    casadi.OP_CONSTPOW: ("{}^{}", POWER, (ATOM, ATOM)),
    casadi.OP_LT: ("{} < {}", SUM, (SUM, NEGATIVE)),
    casadi.OP_LE: ("{} <= {}", SUM, (SUM, NEGATIVE)),
    casadi.OP_EQ: ("{} == {}", SUM, (SUM, NEGATIVE)),
    casadi.OP_NE: ("{} != {}", SUM, (SUM, NEGATIVE)),
    casadi.OP_IF_ELSE_ZERO: ("({})*{}", PRODUCT, (SUM, POWER)),
}
"""Operations with infix operators: template, own binding strength, least strength of operands."""


class Infix:
    """Printer of graph nodes as infix expressions, in the grammar of `mbs.expressions`.

    Args:
        graph: graph to print.
        inputs: input name to the names of its elements.
    """

    def __init__(self, graph: Graph, inputs: Mapping[str, Sequence[str]]) -> None:
        self._graph, self._inputs = graph, inputs

    def text(self, number: int, tightness: int = SUM) -> str:
        """Return the text of node `number`, in brackets if it binds weaker than `tightness`.

        `tightness` is SUM, NEGATIVE, PRODUCT, POWER or ATOM, from weak to strong.
        """
        text, own = self._write(number)
        return f"({text})" if own < tightness else text

    def _write(self, number: int) -> tuple[str, int]:
        """Return the text of the node `number` and its binding strength: higher binds tighter."""
        return self._expression(self._graph.nodes[number])

    def _expression(self, node: Node) -> tuple[str, int]:
        """Return the text of a node and its binding strength: higher binds tighter."""
        if node.op == casadi.OP_CONST:
            return f"{node.value:.12g}", ATOM if node.value >= 0 else NEGATIVE
        if node.op == casadi.OP_INPUT:
            return self._inputs[self._graph.inputs[node.args[0]].name][node.args[1]], ATOM
        if node.op == casadi.OP_ASSIGN:
            return self._write(node.args[0])
        if node.op in _SIGNS:
            form, own, levels = _SIGNS[node.op]
            operands = zip(node.args, levels, strict=True)
            return form.format(*(self.text(number, level) for number, level in operands)), own
        return f"{self._call_text(node.op)}({', '.join(map(self.text, node.args))})", ATOM

    def _call_text(self, op: int) -> str:
        """Return the name of the operation `op` in a function call."""
        return NAMES[op]
