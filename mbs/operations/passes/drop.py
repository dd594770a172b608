"""Leave out what no output needs."""

from __future__ import annotations

from collections.abc import Iterable

import casadi

from mbs.operations.graph import Graph, Node


def drop(graph: Graph, parameters: Iterable[str] = ()) -> Graph:
    """The same graph without the nodes that no output needs."""
    numbers = [-1] * len(graph.nodes)
    nodes: list[Node] = []
    for number, alive in enumerate(graph.live()):
        if alive:
            node = graph.nodes[number]
            if node.op not in (casadi.OP_INPUT, casadi.OP_CONST):
                node = node._replace(args=tuple(numbers[a] for a in node.args))
            numbers[number] = len(nodes)
            nodes.append(node)
    return graph.with_nodes(nodes, [[numbers[n] for n in result] for result in graph.results])
