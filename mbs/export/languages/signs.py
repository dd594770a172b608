"""Scalars computed with the opposite sign, where it is the opposite that has a name."""

from __future__ import annotations

from collections.abc import Iterable

import casadi

from mbs.operations.graph import Graph, Node

TURNED = frozenset(
    {
        *(casadi.OP_ADD, casadi.OP_SUB, casadi.OP_TWICE),
        *(casadi.OP_MUL, casadi.OP_DIV),
    }
)
"""Operations whose opposite takes the same operations and signs, which are free."""


def turned(graph: Graph, numbers: Iterable[int]) -> tuple[Graph, dict[int, int]]:
    """The same results, some nodes computed with the opposite sign.

    Args:
        graph: any.
        numbers: nodes whose opposites are to be computed, all of operations in `TURNED`.

    Returns:
        the graph, in which the sign that such a node lost stands in front of it wherever it is
        used, and the new number of every node: of those, that of the opposite.
    """
    wanted = set(numbers)
    nodes: list[Node] = []
    value: list[int] = []
    known: dict[int, int] = {}

    def added(node: Node) -> int:
        nodes.append(node)
        return len(nodes) - 1

    for number, node in enumerate(graph.nodes):
        operands = tuple(value[k] for k in graph.operands(number))
        node = Node(node.op, operands or node.args, node.value)
        if number not in wanted:
            known[number] = added(node)
            value.append(known[number])
            continue
        if node.op == casadi.OP_SUB:
            opposite = Node(casadi.OP_SUB, operands[::-1])
        else:
            first = added(Node(casadi.OP_NEG, operands[:1]))
            op = casadi.OP_SUB if node.op == casadi.OP_ADD else node.op
            opposite = Node(op, (first, *operands[1:]))
        known[number] = added(opposite)
        value.append(added(Node(casadi.OP_NEG, (known[number],))))
    return graph.with_nodes(nodes, [[value[k] for k in r] for r in graph.results]), known
