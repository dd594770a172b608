"""From a Function to its lines: the graph, the names, the expressions."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import casadi
from casadi import Function

from mbs.export.languages.header import header, tables
from mbs.export.languages.language import Language
from mbs.export.languages.names import Names, spelled_names
from mbs.export.languages.plan import LEAVES, LinePlan, arranged, plan_of
from mbs.export.languages.quantities import angle_names, element_names, elements_of, places
from mbs.export.languages.signs import TURNED, turned
from mbs.export.languages.symbolic import SympyWriter, number_of, symbol
from mbs.export.languages.unit import Argument, CodeUnit, Expr, Load, Store
from mbs.operations.graph import Graph, Port, graph_of

_PARAMETERS = ("p",)


def build(function: Function, language: Language, name: str) -> CodeUnit:
    """The function in lines, named for a language and under a name of its own."""
    graph, given, reserved = _graph(function, name)
    inputs, outputs = (
        [_element_names(function, port, language) for port in ports]
        for ports in (graph.inputs, graph.outputs)
    )
    alive = graph.live()
    angles = {n: name for n, name in angle_names(graph, inputs).items() if alive[n]}
    graph, new = arranged(graph, [*angles, *given])
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
    """The operations of a Function, the nodes that the model has named, and all its names."""
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
    """The graph and its nodes that have a name, those of opposite sign turned."""
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
        if number not in given and graph.nodes[number].op in TURNED
    }
    graph, new = turned(graph, opposite)
    return graph, {new[number]: name for number, name in (given | opposite).items()}


def _element_names(function: Function, port: Port, language: Language) -> list[str]:
    names = element_names(port, elements_of(function, port.name))
    return names if language.scalars_by_name or names != [port.name] else [f"{port.name}1"]


def _is_scalar(function: Function, port: Port) -> bool:
    return port.sparsity.shape == (1, 1) and not elements_of(function, port.name)


def _result_names(graph: Graph, outputs: Sequence[Sequence[str]]) -> Iterator[tuple[int, str]]:
    """Elements of outputs row by row, so that the upper half names a symmetric matrix."""
    for port, result, names in zip(graph.outputs, graph.results, outputs, strict=True):
        rows = zip(places(port), result, names, strict=True)
        for _, number, name in sorted(rows, key=lambda row: row[0]):
            if graph.nodes[number].op not in LEAVES:
                yield number, name


def _line_names(plan: LinePlan, wanted: dict[int, str], reserved: set[str]) -> dict[int, str]:
    """What every line is called; Z and a number where nothing names it."""
    names: dict[int, str] = {}
    taken = reserved.union(wanted.values())
    free = (name for k in itertools.count(1) if (name := f"Z{k}") not in taken)
    for number in (*plan.fixed, *plan.changing):
        names[number] = wanted[number] if number in wanted else next(free)
    return names


def _loads(graph: Graph, arguments: Sequence[Argument], names: Names) -> Iterator[Load]:
    used = sorted(
        (node.args, number) for number, node in enumerate(graph.nodes) if node.op == casadi.OP_INPUT
    )
    every = [places(port) for port in graph.inputs]
    for (which, element), number in used:
        yield Load(names.nodes[number], arguments[which], *every[which][element])


def _stores(graph: Graph, arguments: Sequence[Argument], names: Names) -> Iterator[Store]:
    labels = names.elements[len(graph.inputs) :]
    rows = zip(graph.outputs, graph.results, arguments, labels, strict=True)
    for port, result, argument, some in rows:
        for place, number, label in zip(places(port), result, some, strict=True):
            node = graph.nodes[number]
            if node.op != casadi.OP_CONST or node.value != 0:
                yield Store(argument, *place, _value(graph, number, names), label)


def _value(graph: Graph, number: int, names: Names) -> Expr:
    node = graph.nodes[number]
    if node.op == casadi.OP_CONST:
        return number_of(node.value)
    return symbol(names.nodes[number])
