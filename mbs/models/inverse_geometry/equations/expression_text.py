"""Scalar expressions as lines that people read, what is used twice under a name of its own."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

import casadi

from mbs.operations.graph import Graph, Node
from mbs.operations.text import ATOM, NEGATIVE, PRODUCT, SUM, Infix

_SHORT = 14
"""Characters of an expression that is repeated rather than named."""

_SUMS = {casadi.OP_ADD, casadi.OP_SUB}
_PRODUCTS = {casadi.OP_MUL, casadi.OP_TWICE, casadi.OP_NEG}


def expression_lines(
    graph: Graph, inputs: Mapping[str, Sequence[str]], results: Sequence[str], prefix: str
) -> list[str]:
    """The elements of the only output of a graph, each as `name = expression`.

    Args:
        graph: what is computed.
        inputs: names of the elements of every input, by its name.
        results: names of the elements of the output.
        prefix: with a number behind it, the name of what stands in several expressions.
    """
    writer = _LineWriter(graph, inputs, prefix)
    texts = [writer.text(number) for number in graph.results[0]]
    written = [f"{name} = {text}" for name, text in zip(results, texts, strict=True)]
    return [*writer.lines, *written]


class _LineWriter(Infix):
    """What writes the nodes of a graph.

    Attributes:
        lines: `name = expression` of what is used more than once.
    """

    def __init__(self, graph: Graph, inputs: Mapping[str, Sequence[str]], prefix: str) -> None:
        super().__init__(graph, inputs)
        self.lines: list[str] = []
        self._prefix = prefix
        self._uses = _uses(graph)
        self._known: dict[int, tuple[str, int]] = {}

    def _written(self, number: int) -> tuple[str, int]:
        if number not in self._known:
            text, own = self._expression(self._graph.nodes[number])
            if self._uses[number] > 1 and len(text) > _SHORT:
                name = f"{self._prefix}{len(self.lines) + 1}"
                self.lines.append(f"{name} = {text}")
                text, own = name, ATOM
            self._known[number] = text, own
        return self._known[number]

    def _expression(self, node: Node) -> tuple[str, int]:
        if node.op in _SUMS or self._is_opposite_sum(node):
            return self._sum(node)
        if node.op in _PRODUCTS:
            return self._product(node)
        if node.op in (casadi.OP_SIN, casadi.OP_COS):
            return _sine("S" if node.op == casadi.OP_SIN else "C", self.text(node.args[0])), ATOM
        return super()._expression(node)

    def _product(self, node: Node) -> tuple[str, int]:
        """The product of all numbers, then the other factors in their order."""
        constant, numbers = self._factors(node)
        factors = [self.text(number, PRODUCT) for number in numbers]
        if abs(constant) != 1 or not factors:
            factors.insert(0, f"{abs(constant):.12g}")
        text = "*".join(factors)
        if constant < 0:
            return f"-{text}", NEGATIVE
        alone = self._written(numbers[0])[1] if numbers else ATOM
        return text, PRODUCT if len(factors) > 1 else max(alone, PRODUCT)

    def _factors(self, node: Node) -> tuple[float, list[int]]:
        """A number and the nodes that a product multiplies, products in it taken apart."""
        constant = {casadi.OP_TWICE: 2.0, casadi.OP_NEG: -1.0}.get(node.op, 1.0)
        numbers: list[int] = []
        for number in node.args:
            inner = self._graph.nodes[number]
            if inner.op == casadi.OP_CONST:
                constant *= inner.value
            elif inner.op in _PRODUCTS and (self._uses[number] == 1 or inner.op == casadi.OP_NEG):
                own, others = self._factors(inner)
                constant, numbers = constant * own, [*numbers, *others]
            else:
                numbers.append(number)
        return constant, numbers

    def _sum(self, node: Node) -> tuple[str, int]:
        """Terms in their order, then the sum of all numbers."""
        constant, text = 0.0, ""
        for sign, number in self._terms(node, 1):
            if self._graph.nodes[number].op == casadi.OP_CONST:
                constant += sign * self._graph.nodes[number].value
                continue
            term = self.text(number, NEGATIVE)
            if term.startswith("-"):
                sign, term = -sign, term[1:]
            text += _joined(text, sign, term)
        if constant or not text:
            text += _joined(text, -1 if constant < 0 else 1, f"{abs(constant):.12g}")
        return text, SUM

    def _terms(self, node: Node, sign: int) -> Iterator[tuple[int, int]]:
        """Sign and number of what a sum adds up, sums in it taken apart."""
        last = sign if node.op == casadi.OP_ADD else -sign
        for own, number in zip((sign, last)[-len(node.args) :], node.args, strict=True):
            inner = self._graph.nodes[number]
            if self._uses[number] == 1 and (inner.op in _SUMS or self._is_opposite_sum(inner)):
                yield from self._terms(inner, own)
            else:
                yield own, number

    def _is_opposite_sum(self, node: Node) -> bool:
        """Whether it is the opposite of a sum that stands nowhere else."""
        inner = node.args[0] if node.op == casadi.OP_NEG else -1
        return inner >= 0 and self._graph.nodes[inner].op in _SUMS and self._uses[inner] == 1


def _joined(text: str, sign: int, term: str) -> str:
    """What a term adds to the text of a sum."""
    if not text:
        return f"-{term}" if sign < 0 else term
    return f" - {term}" if sign < 0 else f" + {term}"


def _uses(graph: Graph) -> list[int]:
    """For each node that a result needs how many times it is written."""
    alive, uses = graph.live(), [0] * len(graph.nodes)
    for number in range(len(graph.nodes)):
        if alive[number]:
            for operand in graph.operands(number):
                uses[operand] += 1
    for result in graph.results:
        for number in result:
            uses[number] += 1
    return uses


def _sine(letter: str, angle: str) -> str:
    """S23 for the sine of q2 + q3, sin(elbow) for that of another angle."""
    if re.fullmatch(r"q\d( \+ q\d)*", angle):
        return letter + "".join(re.findall(r"\d", angle))
    return {"S": "sin", "C": "cos"}[letter] + f"({angle})"
