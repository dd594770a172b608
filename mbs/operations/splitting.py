"""What depends on parameters alone, apart from what changes from call to call."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import casadi
from casadi import SX, Function, Sparsity

from mbs.errors import ModelError
from mbs.operations.graph import Graph, Node, Port, function_of, graph_of
from mbs.operations.passes.drop import drop

_CONSTANTS = "c"


@dataclass(frozen=True, slots=True)
class Split:
    """A Function in two: what is done once, and what is done at every call.

    Attributes:
        setup: from the parameters to c, a column of everything that main needs of them.
        main: from the other inputs and c to the outputs.
        inputs: names of the inputs of the Function that was split, in their order.
    """

    setup: Function
    main: Function
    inputs: tuple[str, ...]

    def joined(self) -> Function:
        """The Function that was split: main after setup."""
        sparsity = {
            f.name_in(k): f.sparsity_in(k) for f in (self.main, self.setup) for k in range(f.n_in())
        }
        symbols = {name: SX.sym(name, sparsity[name]) for name in self.inputs}
        constants = self.setup.call([symbols[n] for n in self.setup.name_in()])
        given = [symbols[n] for n in self.main.name_in()[:-1]]
        outputs = self.main.call([*given, *constants])
        names = self.main.name_out()
        return Function(self.main.name(), list(symbols.values()), outputs, self.inputs, names)


def split(function: Function, parameters: Iterable[str] = ("p",)) -> Split:
    """A Function in two, so that work on parameters is not repeated.

    Numbers of c are parameters that main uses as they are, and results that it uses. Constants
    are in main itself. Simplify the Function first, so that there is little of both.

    Args:
        function: made of scalar operations, or a Function that can be expanded to them.
        parameters: names of inputs that do not change from call to call; names that the
            Function does not have are ignored.

    Returns:
        `setup(p) -> c`, of the parameters that the Function has in its order, for a model with
        their defaults, and `main(..., c) -> ...`, of its other inputs and its outputs.

    Raises:
        ModelError: the Function has no scalar operations, or an input is named c.
    """
    graph, names = drop(graph_of(function)), set(parameters)
    if any(port.name == _CONSTANTS for port in graph.inputs):
        raise ModelError(
            f"{function.name()}: its input c has the name of what is computed once; rename it"
        )
    kept = _needed_of_parameters(graph, names)
    column = Port(_CONSTANTS, Sparsity.dense(len(kept), 1))
    setup = function_of(_setup(graph, names, kept, column))
    like = getattr(function, "like", None)
    return Split(
        setup if like is None else like(setup),
        function_of(_main(graph, names, kept, column)),
        tuple(port.name for port in graph.inputs),
    )


def _needed_of_parameters(graph: Graph, names: set[str]) -> list[int]:
    """Parameter-only nodes that outputs or changing nodes use, constants apart."""
    fixed = graph.fixed_by(names)
    used = [number for result in graph.results for number in result]
    for number in range(len(graph.nodes)):
        if not fixed[number]:
            used += graph.operands(number)
    return sorted({n for n in used if fixed[n] and graph.nodes[n].op != casadi.OP_CONST})


def _setup(graph: Graph, names: set[str], kept: list[int], column: Port) -> Graph:
    """The graph from parameters to the kept nodes."""
    inputs = tuple(port for port in graph.inputs if port.name in names)
    nodes = _renumbered(graph, [port.name for port in inputs])
    return Graph(f"{graph.name}_setup", inputs, (column,), nodes, (tuple(kept),))


def _main(graph: Graph, names: set[str], kept: list[int], column: Port) -> Graph:
    """The graph in which the kept nodes are inputs."""
    inputs = tuple(port for port in graph.inputs if port.name not in names)
    nodes = list(_renumbered(graph, [port.name for port in inputs]))
    for position, number in enumerate(kept):
        nodes[number] = Node(casadi.OP_INPUT, (len(inputs), position))
    return drop(Graph(graph.name, (*inputs, column), graph.outputs, tuple(nodes), graph.results))


def _renumbered(graph: Graph, names: list[str]) -> tuple[Node, ...]:
    """The nodes with inputs counted among these names; others are left as they are."""
    place = {k: names.index(p.name) for k, p in enumerate(graph.inputs) if p.name in names}

    def moved(node: Node) -> Node:
        if node.op != casadi.OP_INPUT or node.args[0] not in place:
            return node
        return Node(node.op, (place[node.args[0]], node.args[1]))

    return tuple(moved(node) for node in graph.nodes)
