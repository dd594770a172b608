"""Order the operations so that few values wait at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import casadi

from mbs.operations.builder import COMMUTATIVE
from mbs.operations.graph import Graph, Node
from mbs.operations.passes.drop import drop

_LEAVES = (casadi.OP_INPUT, casadi.OP_CONST)

_Rank = Callable[[int], tuple[int, ...]]


def order(graph: Graph, parameters: Iterable[str] = ()) -> Graph:
    """The same nodes, outputs one after the other and operands in the order that needs less room.

    Where an operation is commutative its operands change places, so that a walk from the outputs
    to the inputs, as CasADi makes it, finds this order.
    Source: Sethi & Ullman 1970, with shared nodes counted where they are met first.
    """
    graph = drop(graph)
    room = _room(graph)
    deep = _depth(graph)
    ranks: list[_Rank] = [
        lambda number: (-room[number], number),
        lambda number: (-deep[number], number),
        lambda number: (room[number], number),
        lambda number: (number,),
    ]
    trials = [_walked(graph, rank) for rank in ranks]
    return min([*trials, graph], key=waiting)


def waiting(graph: Graph) -> int:
    """The largest number of values that are kept at a time, inputs and constants apart."""
    last = list(range(len(graph.nodes)))
    for number in range(len(graph.nodes)):
        for operand in graph.operands(number):
            last[operand] = number
    kept = most = 0
    for number, node in enumerate(graph.nodes):
        if node.op not in _LEAVES:
            ended = {a for a in graph.operands(number) if last[a] == number}
            kept -= sum(1 for a in ended if graph.nodes[a].op not in _LEAVES)
            kept += last[number] > number
            most = max(most, kept)
    return most


def _room(graph: Graph) -> list[int]:
    """Sethi and Ullman's number of values that a node needs, as if nothing were shared."""
    room: list[int] = []
    for number, node in enumerate(graph.nodes):
        needs = sorted((room[a] for a in graph.operands(number)), reverse=True)
        own = 0 if node.op in _LEAVES else 1
        room.append(max([own, *(need + k for k, need in enumerate(needs))]))
    return room


def _depth(graph: Graph) -> list[int]:
    depth: list[int] = []
    for number in range(len(graph.nodes)):
        depth.append(max((depth[a] + 1 for a in graph.operands(number)), default=0))
    return depth


def _walked(graph: Graph, rank: _Rank) -> Graph:
    """The graph in the order of a walk from the outputs, operands of lower rank first."""
    operands = [graph.operands(number) for number in range(len(graph.nodes))]
    for number, node in enumerate(graph.nodes):
        if node.op in COMMUTATIVE:
            operands[number] = tuple(sorted(operands[number], key=rank))
    numbers: dict[int, int] = {}
    nodes: list[Node] = []
    stack = [number for result in reversed(graph.results) for number in reversed(result)]
    while stack:
        number = stack[-1]
        missing = [a for a in operands[number] if a not in numbers]
        if missing and number not in numbers:
            stack.append(missing[0])
            continue
        stack.pop()
        if number not in numbers:
            node = graph.nodes[number]
            if node.op not in _LEAVES:
                node = node._replace(args=tuple(numbers[a] for a in operands[number]))
            numbers[number] = len(nodes)
            nodes.append(node)
    return graph.with_nodes(nodes, [[numbers[n] for n in result] for result in graph.results])
