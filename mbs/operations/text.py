"""CasADi's operations in text: their names, and expressions as people write them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi

from mbs.operations.graph import Graph, Node

NAMES: Mapping[int, str] = {
    code: name.removeprefix("OP_").lower()
    for name, code in vars(casadi).items()
    if name.startswith("OP_")
}
"""What CasADi calls its operations; functions bear the names that they have in C's library."""

CODES: Mapping[str, int] = {name: code for code, name in NAMES.items()}
"""CasADi's code of an operation by its name."""

SUM, NEGATIVE, PRODUCT, POWER, ATOM = range(5)
"""How tightly the outermost operation of a text binds."""

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
"""Operations written with signs: the form, how tightly it binds, what its operands must."""


class Infix:
    """The nodes of a graph as people write them, in the grammar of descriptions.

    Args:
        graph: what is written.
        inputs: names of the elements of every input, by its name.
    """

    def __init__(self, graph: Graph, inputs: Mapping[str, Sequence[str]]) -> None:
        self._graph, self._inputs = graph, inputs

    def text(self, number: int, tightness: int = SUM) -> str:
        """A node, in brackets where it binds less than asked for."""
        text, own = self._write(number)
        return f"({text})" if own < tightness else text

    def _write(self, number: int) -> tuple[str, int]:
        """The text of a node, and how tightly it binds."""
        return self._expression(self._graph.nodes[number])

    def _expression(self, node: Node) -> tuple[str, int]:
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
        return NAMES[op]
