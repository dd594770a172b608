"""Fold constants and move signs to where they are free."""

from __future__ import annotations

from collections.abc import Iterable

import casadi

from mbs.operations.builder import Builder, rebuilt
from mbs.operations.graph import Graph, Node
from mbs.operations.passes.drop import drop


def fold(graph: Graph, parameters: Iterable[str] = ()) -> Graph:
    """Constants computed, 0 and 1 removed, signs moved outwards, one node for equal nodes.

    A sign that is left goes into a difference that nothing else uses: -(x - y) is y - x.
    """
    return drop(_turned(drop(rebuilt(graph, Builder(graph, parameters)))))


def _turned(graph: Graph) -> Graph:
    """Differences of which the negatives alone are used, turned round."""
    negated = {n.args[0] for n in graph.nodes if n.op == casadi.OP_NEG}
    plain = {number for result in graph.results for number in result}
    for number, node in enumerate(graph.nodes):
        if node.op != casadi.OP_NEG:
            plain.update(graph.operands(number))
    turned = {number for number in negated - plain if graph.nodes[number].op == casadi.OP_SUB}
    nodes = list(graph.nodes)
    for number in turned:
        a, b = nodes[number].args
        nodes[number] = Node(casadi.OP_SUB, (b, a))
    for number, node in enumerate(nodes):
        if node.op == casadi.OP_NEG and node.args[0] in turned:
            nodes[number] = Node(casadi.OP_ASSIGN, node.args)
    return _without_assignments(graph.with_nodes(nodes, graph.results))


def _without_assignments(graph: Graph) -> Graph:
    """Whatever uses an assignment uses what is assigned."""
    target = list(range(len(graph.nodes)))
    nodes = list(graph.nodes)
    for number, node in enumerate(nodes):
        if node.op == casadi.OP_ASSIGN:
            target[number] = target[node.args[0]]
        elif node.op not in (casadi.OP_INPUT, casadi.OP_CONST):
            nodes[number] = node._replace(args=tuple(target[a] for a in node.args))
    return graph.with_nodes(nodes, [[target[n] for n in result] for result in graph.results])
