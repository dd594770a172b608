"""A Function as a graph of scalar operations, which passes rewrite and printers print."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import casadi
from casadi import SX, Function, Sparsity

from mbs.errors import ModelError
from mbs.messages import quoted


class Node(NamedTuple):
    """A scalar.

    Attributes:
        op: CasADi's code of the operation, `casadi.OP_...`.
        args: numbers of the nodes it is made of, one or two; of an input, OP_INPUT, the number of
            the input and of the non-zero element in it.
        value: of a constant, OP_CONST.
    """

    op: int
    args: tuple[int, ...] = ()
    value: float = 0.0


class Port(NamedTuple):
    """An input or output: its name and where its elements are."""

    name: str
    sparsity: Sparsity


@dataclass(frozen=True, slots=True, eq=False)
class Graph:
    """Scalar operations in an order in which they can be computed.

    Attributes:
        name: of the Function.
        inputs: its inputs.
        outputs: its outputs.
        nodes: each made of nodes before it.
        results: for each output the numbers of the nodes that are its non-zero elements.
    """

    name: str
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    nodes: tuple[Node, ...]
    results: tuple[tuple[int, ...], ...]

    def operands(self, number: int) -> tuple[int, ...]:
        """The nodes that a node is made of; none of an input or constant."""
        node = self.nodes[number]
        return () if node.op in (casadi.OP_INPUT, casadi.OP_CONST) else node.args

    def live(self) -> list[bool]:
        """For each node, whether an output needs it."""
        alive = [False] * len(self.nodes)
        for result in self.results:
            for number in result:
                alive[number] = True
        for number in reversed(range(len(self.nodes))):
            if alive[number]:
                for operand in self.operands(number):
                    alive[operand] = True
        return alive

    def uses(self) -> list[int]:
        """For each node how often nodes and outputs use it; a square uses its operand once."""
        uses = [0] * len(self.nodes)
        for number in range(len(self.nodes)):
            for operand in self.operands(number):
                uses[operand] += 1
        for result in self.results:
            for number in result:
                uses[number] += 1
        return uses

    def fixed_by(self, names: Iterable[str]) -> list[bool]:
        """For each node, whether constants and the inputs of these names alone determine it."""
        known = {k for k, port in enumerate(self.inputs) if port.name in set(names)}
        fixed: list[bool] = []
        for number, node in enumerate(self.nodes):
            if node.op == casadi.OP_INPUT:
                fixed.append(node.args[0] in known)
            else:
                fixed.append(all(fixed[operand] for operand in self.operands(number)))
        return fixed

    def with_nodes(self, nodes: Sequence[Node], results: Sequence[Sequence[int]]) -> Graph:
        """The same Function computed by other nodes."""
        return replace(self, nodes=tuple(nodes), results=tuple(tuple(r) for r in results))


def graph_of(function: Function) -> Graph:
    """The scalar operations of a Function; one made of MX is expanded first.

    Raises:
        ModelError: it is no Function, or it calls something that has no scalar operations, such
            as an integrator.
    """
    if not isinstance(function, Function) or function.is_null():
        raise ModelError(f"{quoted(function)} is not a Function; give a casadi.Function")
    function = _scalar(function)
    nodes: list[Node] = []
    work: dict[int, int] = {}
    results = [[-1] * function.nnz_out(k) for k in range(function.n_out())]
    for k in range(function.n_instructions()):
        op, target = function.instruction_id(k), function.instruction_output(k)
        source = function.instruction_input(k)
        if op == casadi.OP_OUTPUT:
            results[target[0]][target[1]] = work[source[0]]
            continue
        if op == casadi.OP_INPUT:
            node = Node(op, (source[0], source[1]))
        elif op == casadi.OP_CONST:
            node = Node(op, (), function.instruction_constant(k))
        else:
            node = Node(op, tuple(work[i] for i in source))
        work[target[0]] = len(nodes)
        nodes.append(node)
    return Graph(
        function.name(),
        tuple(Port(n, function.sparsity_in(k)) for k, n in enumerate(function.name_in())),
        tuple(Port(n, function.sparsity_out(k)) for k, n in enumerate(function.name_out())),
        tuple(nodes),
        tuple(tuple(result) for result in results),
    )


def _scalar(function: Function) -> Function:
    """The Function made of scalar operations alone."""
    try:
        scalar = function if function.is_a("SXFunction") else function.expand()
        calls = any(
            scalar.instruction_id(k) == casadi.OP_CALL for k in range(scalar.n_instructions())
        )
    except RuntimeError:
        calls = True
    if calls:
        raise ModelError(
            f"{function.name()}: it is not made of scalar operations; give a Function that"
            " expand() can turn into SX without calls of other Functions, such as integrators or"
            " the iterations that close loops of no known closed form"
        )
    return scalar


def function_of(graph: Graph, defaults: Sequence[float] = ()) -> Function:
    """The Function that computes a graph, nodes that no output needs left out.

    Args:
        graph: what to compute.
        defaults: for each input the number that stands for it when it is not given.
    """
    symbols = [SX.sym(port.name, port.sparsity) for port in graph.inputs]
    elements = [[SX(s.nz[k]) for k in range(s.nnz())] for s in symbols]
    alive = graph.live()
    values = [SX(0)] * len(graph.nodes)
    for number, node in enumerate(graph.nodes):
        if alive[number]:
            values[number] = _value(node, values, elements)
    outputs = [
        SX(port.sparsity, casadi.vertcat(*(values[number] for number in result)))
        if result
        else SX(port.sparsity)
        for port, result in zip(graph.outputs, graph.results, strict=True)
    ]
    names = [port.name for port in graph.inputs], [port.name for port in graph.outputs]
    options = {"default_in": list(defaults)} if defaults else {}
    return Function(graph.name, symbols, outputs, *names, options)


def _value(node: Node, values: Sequence[SX], elements: list[list[SX]]) -> SX:
    if node.op == casadi.OP_INPUT:
        return elements[node.args[0]][node.args[1]]
    if node.op == casadi.OP_CONST:
        return SX(node.value)
    first, *second = (values[number] for number in node.args)
    return SX(SX.binary(node.op, first, *second) if second else SX.unary(node.op, first))
