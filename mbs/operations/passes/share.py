"""Share common parts of sums and products."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import casadi

from mbs.operations.builder import Builder
from mbs.operations.counts import count_graph
from mbs.operations.graph import Graph
from mbs.operations.pairs import Group, extract_pairs
from mbs.operations.passes.fold import fold

_SUMS = {casadi.OP_ADD, casadi.OP_SUB}
_PRODUCTS = {casadi.OP_MUL}
_LONGEST_OPENED = (1, 8)


def share(graph: Graph, parameters: Iterable[str] = ()) -> Graph:
    """Sums and products associated so that parts of several of them are computed once.

    Sums and products are opened to sets of signed terms and of factors; the pair that most sets
    hold becomes a node, until no pair is held twice.
    Source: Breuer 1969, generation of optimal code for expressions via factorization.
    """
    names = tuple(parameters)
    graph = fold(graph, names)
    for ops in (_PRODUCTS, _SUMS):
        trials = (fold(_associated(graph, names, ops, n), names) for n in _LONGEST_OPENED)
        graph = min([graph, *trials], key=lambda trial: count_graph(trial, names).total)
    return graph


def _associated(graph: Graph, parameters: tuple[str, ...], ops: set[int], longest: int) -> Graph:
    """The graph with its sums or products associated anew.

    Args:
        graph: folded.
        parameters: names of inputs.
        ops: either.
        longest: so many elements a group may have that is used elsewhere and opened even so.
    """
    fixed = graph.fixed_by(parameters)
    groups = _opened(graph, ops, fixed, longest)
    known: dict[int, Group] = {}
    for group in groups.values():
        _gather_fixed(group, fixed, known, len(graph.nodes))
    taken = len(graph.nodes) + len(known)
    extract_pairs(groups, taken)
    return _written(graph, {**groups, **known}, Builder(graph, parameters), ops)


def _opened(graph: Graph, ops: set[int], fixed: list[bool], longest: int) -> dict[int, Group]:
    """The terms of every sum, or factors of every product, that is more than part of another."""
    uses = graph.uses()
    groups: dict[int, Group] = {}
    part_of_another: set[int] = set()
    for number, node in enumerate(graph.nodes):
        if node.op not in ops or fixed[number]:
            continue
        signs = (1, -1 if node.op == casadi.OP_SUB else 1)
        for opened in ((0, 1), (0,), (1,), ()):
            parts = [
                _part(groups, operand, position in opened, uses[operand] == 1, longest)
                for position, operand in enumerate(node.args)
            ]
            if not set(parts[0]) & set(parts[1]):
                break
        first, second = (
            part if sign > 0 else {e: -s for e, s in part.items()}
            for part, sign in zip(parts, signs, strict=True)
        )
        groups[number] = {**first, **second}
        part_of_another.update(
            a for k, a in enumerate(node.args) if k in opened and a in groups and uses[a] == 1
        )
    return {number: group for number, group in groups.items() if number not in part_of_another}


def _part(groups: dict[int, Group], number: int, opened: bool, alone: bool, longest: int) -> Group:
    group = groups.get(number)
    if not opened or group is None or (not alone and len(group) > longest):
        return {number: 1}
    return group


def _gather_fixed(group: Group, fixed: list[bool], known: dict[int, Group], first: int) -> None:
    """Replace the parameter-only elements of a group by one, in place."""
    together = {e: s for e, s in group.items() if fixed[e]}
    if len(together) < 2:
        return
    for element in together:
        del group[element]
    name = first + len(known)
    known[name] = together
    group[name] = 1


def _written(graph: Graph, groups: dict[int, Group], builder: Builder, ops: set[int]) -> Graph:
    """The graph in which groups are computed element by element."""
    numbers: dict[int, int] = {}

    def write(name: int) -> None:
        group = groups.get(name)
        if group is None:
            operands = [numbers[a] for a in graph.operands(name)]
            numbers[name] = builder.add(graph.nodes[name], operands)
            return
        combine = builder.sum if ops is _SUMS else builder.product
        total = builder.constant(0.0 if ops is _SUMS else 1.0)
        for element, sign in group.items():
            value = numbers[element]
            total = combine(total, value if sign > 0 else builder.negative(value))
        numbers[name] = total

    for name in _in_order(graph, groups):
        write(name)
    results = [[numbers[n] for n in result] for result in graph.results]
    return graph.with_nodes(builder.nodes, results)


def _in_order(graph: Graph, groups: dict[int, Group]) -> Iterator[int]:
    """Nodes and groups that the outputs need, operands first."""
    done: set[int] = set()
    stack = [number for result in reversed(graph.results) for number in reversed(result)]
    while stack:
        name = stack[-1]
        operands = groups[name] if name in groups else graph.operands(name)
        waiting = [operand for operand in operands if operand not in done]
        if name in done or not waiting:
            stack.pop()
            if name not in done:
                done.add(name)
                yield name
        else:
            stack.extend(reversed(waiting))
