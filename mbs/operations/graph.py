"""A Function as a graph of scalar operations, for passes and printers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import casadi
from casadi import DM, SX, Function, Sparsity

from mbs.errors import ModelError
from mbs.text import quoted


class Node(NamedTuple):
    """Scalar value of a graph: input element, constant or operation.

    Attributes:
        op: CasADi's code of the operation, `casadi.OP_...`.
        args: indices of the one or two operand nodes. For an input (OP_INPUT): index of the input
            and index of the non-zero element in it.
        value: value of a constant (OP_CONST).
    """

    op: int
    args: tuple[int, ...] = ()
    value: float = 0.0


class Port(NamedTuple):
    """Input or output of a Function: its name and its sparsity pattern."""

    name: str
    sparsity: Sparsity


@dataclass(frozen=True, slots=True, eq=False)
class Graph:
    """Scalar operations of a Function in an executable order.

    Attributes:
        name: name of the Function.
        inputs: inputs of the Function.
        outputs: outputs of the Function.
        nodes: nodes; the operands of a node precede it.
        results: node indices of the non-zero elements of each output.
    """

    name: str
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    nodes: tuple[Node, ...]
    results: tuple[tuple[int, ...], ...]

    def operands(self, number: int) -> tuple[int, ...]:
        """Return the indices of the operands of the node `number`.

        Empty for an input or constant.
        """
        node = self.nodes[number]
        return () if node.op in (casadi.OP_INPUT, casadi.OP_CONST) else node.args

    def live(self) -> list[bool]:
        """Return for each node whether an output depends on it."""
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
        """Return for each node the number of its uses by nodes and outputs.

        A square, which has one operand, is one use. A node that is both operands counts twice.
        """
        uses = [0] * len(self.nodes)
        for number in range(len(self.nodes)):
            for operand in self.operands(number):
                uses[operand] += 1
        for result in self.results:
            for number in result:
                uses[number] += 1
        return uses

    def fixed_by(self, names: Iterable[str]) -> list[bool]:
        """Return for each node whether it depends on constants and on the inputs `names` only."""
        known = {k for k, port in enumerate(self.inputs) if port.name in set(names)}
        fixed: list[bool] = []
        for number, node in enumerate(self.nodes):
            if node.op == casadi.OP_INPUT:
                fixed.append(node.args[0] in known)
            else:
                fixed.append(all(fixed[operand] for operand in self.operands(number)))
        return fixed

    def with_nodes(self, nodes: Sequence[Node], results: Sequence[Sequence[int]]) -> Graph:
        """Return the graph with other nodes and other results, and the same inputs and outputs.

        Args:
            nodes: nodes in an executable order.
            results: node indices of the non-zero elements of each output.
        """
        return replace(self, nodes=tuple(nodes), results=tuple(tuple(r) for r in results))


def graph_of(function: Function) -> Graph:
    """Return the graph of the scalar operations of a Function; an MX Function is expanded first.

    Args:
        function: SX Function, or MX Function that can be expanded.

    Raises:
        ModelError: the argument is no Function, or it contains calls without scalar operations,
            such as an integrator.
    """
    if not isinstance(function, Function) or function.is_null():
        raise ModelError(f"{quoted(function)} is not a Function; give a casadi.Function")
    function = expanded(function)
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


def expanded(function: Function) -> Function:
    """Return a Function with its operations expanded to scalars (SX); an SX Function is unchanged.

    Args:
        function: SX Function, or MX Function that can be expanded.

    Raises:
        ModelError: it contains calls without scalar operations, such as an integrator.
    """
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
            " expand() can convert to SX without calls of other Functions, such as integrators or"
            " the iterations that close loops of no known closed form"
        )
    return scalar


def function_of(graph: Graph, defaults: Sequence[float] = ()) -> Function:
    """Return the Function that computes a graph, without the nodes that no output needs.

    Args:
        graph: operations to compute.
        defaults: default value of each input; zeros if empty.
    """
    symbols = [SX.sym(port.name, port.sparsity) for port in graph.inputs]
    elements = [[SX(s.nz[k]) for k in range(s.nnz())] for s in symbols]
    alive = graph.live()
    values = [SX(0)] * len(graph.nodes)
    for number, node in enumerate(graph.nodes):
        if alive[number]:
            values[number] = value_of(node, values, elements)
    outputs = [
        SX(port.sparsity, casadi.vertcat(*(values[number] for number in result)))
        if result
        else SX(port.sparsity)
        for port, result in zip(graph.outputs, graph.results, strict=True)
    ]
    names = [port.name for port in graph.inputs], [port.name for port in graph.outputs]
    options = {"default_in": list(defaults)} if defaults else {}
    return Function(graph.name, symbols, outputs, *names, options)


def value_of(node: Node, values: Sequence[SX], elements: Sequence[Sequence[SX]]) -> SX:
    """Return the SX expression of a node.

    Args:
        node: node of a graph.
        values: expressions of the previous nodes, by index.
        elements: expressions of the non-zero elements of each input.
    """
    if node.op == casadi.OP_INPUT:
        return elements[node.args[0]][node.args[1]]
    if node.op == casadi.OP_CONST:
        return SX(node.value)
    first, *second = (values[number] for number in node.args)
    return SX(SX.binary(node.op, first, *second) if second else SX.unary(node.op, first))


# Construction of graphs node by node: equal nodes merged, constants evaluated, signs outwards.


COMMUTATIVE = {
    *(casadi.OP_ADD, casadi.OP_MUL, casadi.OP_FMIN, casadi.OP_FMAX),
    *(casadi.OP_EQ, casadi.OP_NE, casadi.OP_AND, casadi.OP_OR, casadi.OP_HYPOT),
}
_FREE = {casadi.OP_INPUT, casadi.OP_CONST, casadi.OP_NEG}
_ODD = {
    *(casadi.OP_SIN, casadi.OP_TAN, casadi.OP_ASIN, casadi.OP_ATAN, casadi.OP_SINH),
    *(casadi.OP_TANH, casadi.OP_ASINH, casadi.OP_ATANH, casadi.OP_ERF, casadi.OP_SIGN),
    casadi.OP_INV,
}
_EVEN = {casadi.OP_COS, casadi.OP_COSH, casadi.OP_FABS, casadi.OP_SQ}


class Builder:
    """Builder of the nodes of a graph: equal nodes are merged and constants are evaluated.

    Each method returns the index of the node with the requested value, an existing node if there is
    one. A sign is a separate node. It is moved outwards through sums, products and odd functions,
    so that x - y and y - x, or sin(x) and sin(-x), share their nodes.

    Args:
        graph: graph whose inputs the nodes refer to.
        parameters: names of the inputs that are parameters.

    Attributes:
        nodes: nodes; the operands of a node precede it.
        fixed: whether a node depends on constants and parameters only, for each node.
    """

    def __init__(self, graph: Graph, parameters: Iterable[str] = ()) -> None:
        self.nodes: list[Node] = []
        self.fixed: list[bool] = []
        names = set(parameters)
        self._known = [port.name in names for port in graph.inputs]
        self._numbers: dict[Node, int] = {}
        self._rules: dict[int, Callable[..., int]] = {
            casadi.OP_ASSIGN: lambda a: a,
            casadi.OP_NEG: self.negative,
            casadi.OP_ADD: self.sum,
            casadi.OP_SUB: self.difference,
            casadi.OP_MUL: self.product,
            casadi.OP_TWICE: lambda a: self.product(self.constant(2.0), a),
            casadi.OP_DIV: self.quotient,
            casadi.OP_IF_ELSE_ZERO: self._if_else_zero,
        }

    def node(self, op: int, args: tuple[int, ...], value: float = 0.0) -> int:
        """Return the index of the node of an operation, without simplification.

        Args:
            op: CasADi's code of the operation.
            args: indices of the operands, as in `Node`.
            value: value of a constant.
        """
        if op in COMMUTATIVE and args[1] < args[0]:
            args = (args[1], args[0])
        node = Node(op, args, value)
        number = self._numbers.get(node)
        if number is None:
            number = self._numbers[node] = len(self.nodes)
            self.nodes.append(node)
            self.fixed.append(self._is_fixed(node))
        return number

    def add(self, node: Node, operands: Sequence[int]) -> int:
        """Return the index of a node that computes the same as a node of another graph.

        Args:
            node: node of the other graph.
            operands: indices of its operands in this builder.
        """
        if node.op in (casadi.OP_INPUT, casadi.OP_CONST):
            return self.node(node.op, node.args, node.value)
        return self.apply(node.op, *operands)

    def apply(self, op: int, *operands: int) -> int:
        """Return the index of the simplified result of an operation on nodes.

        Args:
            op: CasADi's code of the operation.
            operands: indices of the one or two operands.
        """
        rule = self._rules.get(op)
        if rule is not None:
            return rule(*operands)
        if all(self.nodes[a].op == casadi.OP_CONST for a in operands):
            return self._fold(op, operands)
        if op in _ODD and self._has_operation(operands[0], casadi.OP_NEG):
            return self.negative(self.apply(op, self.nodes[operands[0]].args[0]))
        if op in _EVEN and self._has_operation(operands[0], casadi.OP_NEG):
            return self.apply(op, self.nodes[operands[0]].args[0])
        return self.node(op, operands)

    def cost_since(self, start: int) -> int:
        """Return the number of nodes with index `start` or more that cost time at every call.

        Inputs, constants, signs and nodes of parameters alone are not counted.
        """
        numbers = range(start, len(self.nodes))
        return sum(1 for n in numbers if not self.fixed[n] and self.nodes[n].op not in _FREE)

    def forget_since(self, start: int) -> None:
        """Remove all nodes with index `start` or more."""
        for node in self.nodes[start:]:
            del self._numbers[node]
        del self.nodes[start:], self.fixed[start:]

    def constant(self, value: float) -> int:
        """Return the index of the node of a constant.

        Args:
            value: value of the constant.
        """
        return self.node(casadi.OP_CONST, (), float(value))

    def value(self, number: int) -> float | None:
        """Return the value of the node `number` if it is a constant; else None."""
        node = self.nodes[number]
        return node.value if node.op == casadi.OP_CONST else None

    def unsigned(self, number: int) -> tuple[int, int]:
        """Return (sign, node) of the value of a node: sign is 1 or -1, and the node has no sign.

        Args:
            number: index of a node.
        """
        node = self.nodes[number]
        if node.op == casadi.OP_NEG:
            return -1, node.args[0]
        if node.op == casadi.OP_CONST and node.value < 0:
            return -1, self.constant(-node.value)
        return 1, number

    def negative(self, a: int) -> int:
        """Return the index of the node -a, for a node index a."""
        node = self.nodes[a]
        if node.op == casadi.OP_NEG:
            return node.args[0]
        if node.op == casadi.OP_CONST:
            return self.constant(-node.value if node.value else 0.0)
        return self.node(casadi.OP_NEG, (a,))

    def sum(self, a: int, b: int) -> int:
        """Return the index of the node a + b, for node indices a and b."""
        folded = self._both_constant(casadi.OP_ADD, a, b)
        if folded is not None:
            return folded
        (sign_a, a), (sign_b, b) = self.unsigned(a), self.unsigned(b)
        if sign_a != sign_b:
            return self._subtract(a, b) if sign_a > 0 else self._subtract(b, a)
        if self.value(a) == 0.0:
            result = b
        elif self.value(b) == 0.0:
            result = a
        elif a == b:
            result = self.product(self.constant(2.0), a)
        else:
            result = self._plain_sum(a, b)
        return result if sign_a > 0 else self.negative(result)

    def difference(self, a: int, b: int) -> int:
        """Return the index of the node a - b, for node indices a and b."""
        return self.sum(a, self.negative(b))

    def product(self, a: int, b: int) -> int:
        """Return the index of the node a b, for node indices a and b."""
        folded = self._both_constant(casadi.OP_MUL, a, b)
        if folded is not None:
            return folded
        (sign_a, a), (sign_b, b) = self.unsigned(a), self.unsigned(b)
        if self.nodes[b].op == casadi.OP_CONST:
            a, b = b, a
        result = self._multiply(a, b)
        return result if sign_a == sign_b else self.negative(result)

    def quotient(self, a: int, b: int) -> int:
        """Return the index of the node a / b, for node indices a and b.

        A product if b is constant.
        """
        (sign_a, a), (sign_b, b) = self.unsigned(a), self.unsigned(b)
        divisor = self.value(b)
        if self.value(a) == 1.0:
            result = self.apply(casadi.OP_INV, b)
        elif divisor and math.isfinite(1.0 / divisor):
            result = self.product(self.constant(1.0 / divisor), a)
        else:
            result = self.node(casadi.OP_DIV, (a, b))
        return result if sign_a == sign_b else self.negative(result)

    def _multiply(self, a: int, b: int) -> int:
        """Return the index of a b for nodes without signs; if one of them is constant, it is a."""
        factor = self.value(a)
        if factor == 0.0:
            return a
        if factor == 1.0:
            return b
        if a == b:
            return self.node(casadi.OP_SQ, (a,))
        if factor is None:
            return self.node(casadi.OP_MUL, (a, b))
        inner = self.nodes[b]
        if inner.op == casadi.OP_TWICE:
            return self.product(self.constant(2.0 * factor), inner.args[0])
        if inner.op == casadi.OP_MUL:
            for one, other in (inner.args, inner.args[::-1]):
                if (known := self.value(one)) is not None:
                    return self.product(self.constant(known * factor), other)
        if factor == 2.0:
            return self.node(casadi.OP_TWICE, (b,))
        return self.node(casadi.OP_MUL, (a, b))

    def _plain_sum(self, a: int, b: int) -> int:
        """Return the index of a + b for nodes without signs; x if they are x - y and y."""
        for one, other in ((a, b), (b, a)):
            if self._has_operation(one, casadi.OP_SUB) and self.nodes[one].args[1] == other:
                return self.nodes[one].args[0]
        return self.node(casadi.OP_ADD, (a, b))

    def _remainder(self, a: int, b: int) -> int | None:
        """Return the index of a - b if a is a sum or difference that contains b; else None."""
        node = self.nodes[a]
        if node.op == casadi.OP_ADD and b in node.args:
            return node.args[1] if node.args[0] == b else node.args[0]
        if node.op == casadi.OP_SUB and node.args[0] == b:
            return self.negative(node.args[1])
        return None

    def _subtract(self, a: int, b: int) -> int:
        """Return the index of a - b for nodes without signs; that of -(b - a) if b - a exists."""
        if a == b:
            return self.constant(0.0)
        if self.value(b) == 0.0:
            return a
        if self.value(a) == 0.0:
            return self.negative(b)
        if (rest := self._remainder(a, b)) is not None:
            return rest
        if (rest := self._remainder(b, a)) is not None:
            return self.negative(rest)
        opposite = self._numbers.get(Node(casadi.OP_SUB, (b, a)))
        if opposite is not None:
            return self.negative(opposite)
        return self.node(casadi.OP_SUB, (a, b))

    def _if_else_zero(self, condition: int, value: int) -> int:
        """Return the index of the node that is `value` if `condition` is not zero, else 0."""
        if self.value(value) == 0.0 or self.value(condition) == 0.0:
            return self.constant(0.0)
        if self.value(condition) is not None:
            return value
        sign, value = self.unsigned(value)
        result = self.node(casadi.OP_IF_ELSE_ZERO, (condition, value))
        return result if sign > 0 else self.negative(result)

    def _both_constant(self, op: int, a: int, b: int) -> int | None:
        """Return the index of the sum or product (`op`) of two constants.

        None for other operands.
        """
        one, other = self.nodes[a], self.nodes[b]
        if one.op != casadi.OP_CONST or other.op != casadi.OP_CONST:
            return None
        product = op == casadi.OP_MUL
        return self.constant(one.value * other.value if product else one.value + other.value)

    def _fold(self, op: int, operands: Sequence[int]) -> int:
        """Evaluate the operation `op` on constants.

        It remains a node if the result is not finite.
        """
        numbers = [DM(self.nodes[a].value) for a in operands]
        result = DM.unary(op, *numbers) if len(numbers) == 1 else DM.binary(op, *numbers)
        if not math.isfinite(float(result)):
            return self.node(op, tuple(operands))
        return self.constant(float(result))

    def _has_operation(self, number: int, op: int) -> bool:
        """Return whether the node `number` has the operation `op`."""
        return self.nodes[number].op == op

    def _is_fixed(self, node: Node) -> bool:
        """Return whether a node depends on constants and parameters only."""
        if node.op == casadi.OP_INPUT:
            return self._known[node.args[0]]
        return node.op == casadi.OP_CONST or all(self.fixed[a] for a in node.args)


def rebuild(graph: Graph, builder: Builder) -> Graph:
    """Return the graph with its live nodes built again by a builder, which simplifies them."""
    numbers = [-1] * len(graph.nodes)
    for number, alive in enumerate(graph.live()):
        if alive:
            operands = [numbers[a] for a in graph.operands(number)]
            numbers[number] = builder.add(graph.nodes[number], operands)
    results = [[numbers[number] for number in result] for result in graph.results]
    return graph.with_nodes(builder.nodes, results)


# Removal of unused nodes.


def drop(graph: Graph, parameters: Iterable[str] = ()) -> Graph:
    """Return the graph without the nodes that no output needs; `parameters` has no effect."""
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
