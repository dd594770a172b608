"""Conversion of a Function to lines of code: graph, names and expressions."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import casadi
from casadi import Function

from mbs.export.languages.header import (
    angle_names,
    element_names,
    elements_of,
    header,
    places,
    tables,
)
from mbs.export.languages.language import Argument, CodeUnit, Expr, Language, Load, Store
from mbs.export.languages.plan import LEAVES, LinePlan, arrange, plan_of
from mbs.export.languages.symbolic import SympyWriter, number_of, symbol
from mbs.operations.graph import Graph, Node, Port, graph_of

# Names of arguments, their elements, and lines.


_Key = tuple[str, int, int]
"""Key of a named item: ("argument", k, 0), ("element", k, e) or ("node", number, 0)."""

_FUNCTION: _Key = ("function", 0, 0)


@dataclass(frozen=True, slots=True)
class Names:
    """Names of a function, its arguments, elements and lines, which are valid in a language.

    Attributes:
        function: name of the function.
        arguments: names of inputs, then of outputs.
        elements: names of the structurally nonzero elements of each argument.
        nodes: name by node index, for lines and elements of inputs.
    """

    function: str
    arguments: list[str]
    elements: list[list[str]]
    nodes: dict[int, str]


def spelled_names(
    graph: Graph, language: Language, lines: Mapping[int, str], elements: Sequence[Sequence[str]]
) -> Names:
    """Return valid, distinct names of arguments, elements and lines.

    If two desired names are equal, an argument keeps its name. An input or output with the name of
    its only element is the same variable as the element. An output element with the name of the
    line that computes it is the same variable as the line.

    Args:
        graph: graph from `arrange`.
        language: language of the text.
        lines: desired name of each line, by node index.
        elements: desired names of the elements of each input, then of each output.
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
    """Return the keys of the elements of argument k; an only element of its name shares its key."""
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
    """Unify keys of equal variables in `keys` and `nodes`, which are changed.

    Input nodes share the keys of input elements, and output elements those of their lines.
    """
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
    """Return the pairs of key and name of the elements of all arguments."""
    return [
        pair
        for some, wanted in zip(keys, names, strict=True)
        for pair in zip(some, wanted, strict=True)
    ]


# Nodes that are computed with the opposite sign, because the model names the opposite.


NEGATABLE = frozenset(
    {
        *(casadi.OP_ADD, casadi.OP_SUB, casadi.OP_TWICE),
        *(casadi.OP_MUL, casadi.OP_DIV),
    }
)
"""Operations whose negative needs no additional operation except signs, which cost nothing."""


def negate_nodes(graph: Graph, numbers: Iterable[int]) -> tuple[Graph, dict[int, int]]:
    """Return an equivalent graph in which some nodes are computed with the opposite sign.

    Args:
        graph: graph of scalar operations.
        numbers: indices of nodes to negate, with operations in `NEGATABLE`.

    Returns:
        Graph in which the uses of a negated node are preceded by a sign, and the new index of each
        node by its old index. For a negated node it is the index of the node with the negative
        value.
    """
    wanted = set(numbers)
    nodes: list[Node] = []
    value: list[int] = []
    known: dict[int, int] = {}

    def add(node: Node) -> int:
        nodes.append(node)
        return len(nodes) - 1

    for number, node in enumerate(graph.nodes):
        operands = tuple(value[k] for k in graph.operands(number))
        node = Node(node.op, operands or node.args, node.value)
        if number not in wanted:
            known[number] = add(node)
            value.append(known[number])
            continue
        if node.op == casadi.OP_SUB:
            opposite = Node(casadi.OP_SUB, operands[::-1])
        else:
            first = add(Node(casadi.OP_NEG, operands[:1]))
            op = casadi.OP_SUB if node.op == casadi.OP_ADD else node.op
            opposite = Node(op, (first, *operands[1:]))
        known[number] = add(opposite)
        value.append(add(Node(casadi.OP_NEG, (known[number],))))
    return graph.with_nodes(nodes, [[value[k] for k in r] for r in graph.results]), known


_PARAMETERS = ("p",)


def build(function: Function, language: Language, name: str) -> CodeUnit:
    """Convert a Function to lines of code with names that are valid in a language.

    Args:
        function: Function of scalar operations, or a Function that can be expanded to them.
        language: language of the text.
        name: name of the function in the text.

    Raises:
        ModelError: the Function has operations without a scalar expansion, or constants that are
            not finite.
    """
    graph, given, reserved = _graph(function, name)
    inputs, outputs = (
        [_element_names(function, port, language) for port in ports]
        for ports in (graph.inputs, graph.outputs)
    )
    alive = graph.live()
    angles = {n: name for n, name in angle_names(graph, inputs).items() if alive[n]}
    graph, new = arrange(graph, [*angles, *given])
    wanted: dict[int, str] = {}
    for number, name in [*given.items(), *angles.items()]:
        wanted.setdefault(new[number], name)
    for number, name in _result_names(graph, outputs):
        wanted.setdefault(number, name)
    plan = plan_of(graph, wanted, _PARAMETERS)
    names = spelled_names(graph, language, _line_names(plan, wanted, reserved), [*inputs, *outputs])
    arguments = [
        Argument(name, *port.sparsity.shape, _is_scalar(function, port))
        for name, port in zip(names.arguments, [*graph.inputs, *graph.outputs], strict=True)
    ]
    into, out_of = tuple(arguments[: len(inputs)]), tuple(arguments[len(inputs) :])
    writer = SympyWriter(plan, names.nodes, language.squares_as_products)
    return CodeUnit(
        names.function,
        header(function, graph, arguments, names.elements),
        tables(function),
        into,
        out_of,
        tuple(_loads(graph, into, names)),
        tuple(writer.line(number) for number in plan.fixed),
        tuple(writer.line(number) for number in plan.changing),
        tuple(_stores(graph, out_of, names)),
    )


def _graph(function: Function, name: str) -> tuple[Graph, dict[int, str], set[str]]:
    """Return the graph of a Function, the names of its nodes in the model, and all these names.

    `name` becomes the name of the graph.
    """
    annotated = getattr(function, "annotated", None)
    named = annotated() if annotated is not None else None
    graph = graph_of(function if named is None else named)
    count = function.n_out()
    extra = zip(graph.outputs[count:], graph.results[count:], strict=True)
    pairs = [(result[0], port.name) for port, result in extra if len(result) == 1]
    graph = replace(
        graph,
        name=name,
        outputs=graph.outputs[:count],
        results=graph.results[:count],
    )
    graph, given = _named(graph, pairs)
    return graph, given, {name for _, name in pairs}


def _named(graph: Graph, pairs: Sequence[tuple[int, str]]) -> tuple[Graph, dict[int, str]]:
    """Return a graph and the names of its nodes, from pairs of node and name.

    A node whose negative has a name is computed with the opposite sign.
    """
    alive = graph.live()
    given: dict[int, str] = {}
    opposite: dict[int, str] = {}
    for number, name in pairs:
        node = graph.nodes[number]
        if alive[number] and node.op not in LEAVES:
            given.setdefault(number, name)
        elif node.op == casadi.OP_NEG and alive[node.args[0]]:
            opposite.setdefault(node.args[0], name)
    opposite = {
        number: name
        for number, name in opposite.items()
        if number not in given and graph.nodes[number].op in NEGATABLE
    }
    graph, new = negate_nodes(graph, opposite)
    return graph, {new[number]: name for number, name in (given | opposite).items()}


def _element_names(function: Function, port: Port, language: Language) -> list[str]:
    """Return the names of the elements of an input or output in a language."""
    names = element_names(port, elements_of(function, port.name))
    return names if language.scalars_by_name or names != [port.name] else [f"{port.name}1"]


def _is_scalar(function: Function, port: Port) -> bool:
    """Whether an input or output is a scalar, and not a vector with a single named element."""
    return port.sparsity.shape == (1, 1) and not elements_of(function, port.name)


def _result_names(graph: Graph, outputs: Sequence[Sequence[str]]) -> Iterator[tuple[int, str]]:
    """Yield (node, name) of the output elements row by row.

    A symmetric matrix thus gets the names of its upper triangle. Inputs and constants are left out.
    """
    for port, result, names in zip(graph.outputs, graph.results, outputs, strict=True):
        rows = zip(places(port), result, names, strict=True)
        for _, number, name in sorted(rows, key=lambda row: row[0]):
            if graph.nodes[number].op not in LEAVES:
                yield number, name


def _line_names(plan: LinePlan, wanted: dict[int, str], reserved: set[str]) -> dict[int, str]:
    """Return the name of each line by node index: its name in `wanted`, or else Z1, Z2, ....

    `reserved` are names that must not be used for other lines.
    """
    names: dict[int, str] = {}
    taken = reserved.union(wanted.values())
    free = (name for k in itertools.count(1) if (name := f"Z{k}") not in taken)
    for number in (*plan.fixed, *plan.changing):
        names[number] = wanted[number] if number in wanted else next(free)
    return names


def _loads(graph: Graph, arguments: Sequence[Argument], names: Names) -> Iterator[Load]:
    """Yield the assignments of the elements of inputs (`arguments`) that are used."""
    used = sorted(
        (node.args, number) for number, node in enumerate(graph.nodes) if node.op == casadi.OP_INPUT
    )
    every = [places(port) for port in graph.inputs]
    for (which, element), number in used:
        yield Load(names.nodes[number], arguments[which], *every[which][element])


def _stores(graph: Graph, arguments: Sequence[Argument], names: Names) -> Iterator[Store]:
    """Yield the assignments of the elements of outputs (`arguments`) that are not zero."""
    labels = names.elements[len(graph.inputs) :]
    rows = zip(graph.outputs, graph.results, arguments, labels, strict=True)
    for port, result, argument, some in rows:
        for place, number, label in zip(places(port), result, some, strict=True):
            node = graph.nodes[number]
            if node.op != casadi.OP_CONST or node.value != 0:
                yield Store(argument, *place, _value(graph, number, names), label)


def _value(graph: Graph, number: int, names: Names) -> Expr:
    """Return a node as a sympy number or symbol."""
    node = graph.nodes[number]
    if node.op == casadi.OP_CONST:
        return number_of(node.value)
    return symbol(names.nodes[number])
