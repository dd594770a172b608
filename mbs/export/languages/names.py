"""Who bears which name in a text: arguments, their elements, and lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi

from mbs.export.languages.language import Language
from mbs.operations.graph import Graph

_Key = tuple[str, int, int]
"""What bears a name: an argument, an element of it, or a node; zero where a number is spare."""

_FUNCTION: _Key = ("function", 0, 0)


@dataclass(frozen=True, slots=True)
class Names:
    """Every name of a text, as its language takes it.

    Attributes:
        function: of the function.
        arguments: of inputs and outputs.
        elements: of every element of them that is not zero.
        nodes: of lines and of elements of inputs, by node.
    """

    function: str
    arguments: list[str]
    elements: list[list[str]]
    nodes: dict[int, str]


def spelled_names(
    graph: Graph, language: Language, lines: Mapping[int, str], elements: Sequence[Sequence[str]]
) -> Names:
    """The names as the language takes them; where two meet, an argument keeps its own first.

    An input or output that is called like its only element is one variable with it, and so is an
    element of an output with the line that computes it.

    Args:
        graph: arranged.
        language: takes the names.
        lines: wanted name of every line, by node.
        elements: wanted names of the elements of every input, then of every output.
    """
    inside = [port.name for port in graph.inputs]
    outside = [f"{p.name}_out" if p.name in inside else p.name for p in graph.outputs]
    arguments = [*inside, *outside]
    keys = [_own_keys(k, name, elements[k]) for k, name in enumerate(arguments)]
    nodes = {number: ("node", number, 0) for number in lines}
    _unite(graph, lines, elements, keys, nodes)
    first = len(inside)
    wanted = [(_FUNCTION, graph.name)]
    wanted += [(("argument", k, 0), name) for k, name in enumerate(arguments)]
    wanted += _pairs(keys[:first], elements[:first])
    wanted += [(nodes[number], name) for number, name in lines.items()]
    wanted += _pairs(keys[first:], elements[first:])
    bearers: dict[_Key, str] = {}
    for key, name in wanted:
        bearers.setdefault(key, name)
    spelled = dict(zip(bearers, language.distinct(bearers.values()), strict=True))
    return Names(
        spelled[_FUNCTION],
        [spelled["argument", k, 0] for k in range(len(arguments))],
        [[spelled[key] for key in some] for some in keys],
        {number: spelled[key] for number, key in nodes.items()},
    )


def _own_keys(k: int, argument: str, elements: Sequence[str]) -> list[_Key]:
    if list(elements) == [argument]:
        return [("argument", k, 0)]
    return [("element", k, e) for e in range(len(elements))]


def _unite(
    graph: Graph,
    lines: Mapping[int, str],
    elements: Sequence[Sequence[str]],
    keys: list[list[_Key]],
    nodes: dict[int, _Key],
) -> None:
    """Give nodes the keys of the elements that they are, and elements those of their lines."""
    for number, node in enumerate(graph.nodes):
        if node.op == casadi.OP_INPUT:
            nodes[number] = keys[node.args[0]][node.args[1]]
    for k, result in enumerate(graph.results, len(graph.inputs)):
        for e, number in enumerate(result):
            if lines.get(number) != elements[k][e]:
                continue
            if keys[k][e][0] == "argument":
                nodes[number] = keys[k][e]
            keys[k][e] = nodes[number]


def _pairs(
    keys: Sequence[Sequence[_Key]], names: Sequence[Sequence[str]]
) -> list[tuple[_Key, str]]:
    return [
        pair
        for some, wanted in zip(keys, names, strict=True)
        for pair in zip(some, wanted, strict=True)
    ]
