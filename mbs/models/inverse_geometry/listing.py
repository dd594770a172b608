"""Text listing of the closed form of a robot: equations and signs, joint by joint."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.closed_forms.sequence import Problem, SequenceStep, StepSequence
from mbs.models.inverse_geometry.chain import FrameChain, frame_chain
from mbs.models.inverse_geometry.closed_form import sequence_of
from mbs.operations import simplify
from mbs.operations.graph import Graph, Node, graph_of
from mbs.operations.text import ATOM, NEGATIVE, PRODUCT, SUM, Infix

# Scalar expressions as lines of text, with names for common subexpressions.


_SHORT = 14
"""Largest number of characters of a common subexpression that is repeated instead of named."""

_SUMS = {casadi.OP_ADD, casadi.OP_SUB}
_PRODUCTS = {casadi.OP_MUL, casadi.OP_TWICE, casadi.OP_NEG}


def expression_lines(
    graph: Graph, inputs: Mapping[str, Sequence[str]], results: Sequence[str], prefix: str
) -> list[str]:
    """Write the elements of the first output of a graph as lines `name = expression`.

    Args:
        graph: expression graph with one output.
        inputs: names of the elements of each input, by name of the input.
        results: names of the elements of the output.
        prefix: prefix of the names of common subexpressions; a counter is appended.
    """
    writer = _LineWriter(graph, inputs, prefix)
    texts = [writer.text(number) for number in graph.results[0]]
    written = [f"{name} = {text}" for name, text in zip(results, texts, strict=True)]
    return [*writer.lines, *written]


class _LineWriter(Infix):
    """Writer of the nodes of a graph as infix text.

    Attributes:
        lines: lines `name = expression` of the common subexpressions so far.
    """

    def __init__(self, graph: Graph, inputs: Mapping[str, Sequence[str]], prefix: str) -> None:
        super().__init__(graph, inputs)
        self.lines: list[str] = []
        self._prefix = prefix
        self._uses = _uses(graph)
        self._known: dict[int, tuple[str, int]] = {}

    def _write(self, number: int) -> tuple[str, int]:
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
        """Write the product of all constants, then the other factors in order."""
        constant, numbers = self._factors(node)
        factors = [self.text(number, PRODUCT) for number in numbers]
        if abs(constant) != 1 or not factors:
            factors.insert(0, f"{abs(constant):.12g}")
        text = "*".join(factors)
        if constant < 0:
            return f"-{text}", NEGATIVE
        alone = self._write(numbers[0])[1] if numbers else ATOM
        return text, PRODUCT if len(factors) > 1 else max(alone, PRODUCT)

    def _factors(self, node: Node) -> tuple[float, list[int]]:
        """Flatten nested products: return the constant factor and the other factor nodes."""
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
        """Write the terms in order, then the sum of all constants."""
        constant, text = 0.0, ""
        for sign, number in self._terms(node, 1):
            if self._graph.nodes[number].op == casadi.OP_CONST:
                constant += sign * self._graph.nodes[number].value
                continue
            term = self.text(number, NEGATIVE)
            if term.startswith("-"):
                sign, term = -sign, term[1:]
            text += _join(text, sign, term)
        if constant or not text:
            text += _join(text, -1 if constant < 0 else 1, f"{abs(constant):.12g}")
        return text, SUM

    def _terms(self, node: Node, sign: int) -> Iterator[tuple[int, int]]:
        """Flatten nested sums: yield the sign and node number of each term."""
        last = sign if node.op == casadi.OP_ADD else -sign
        for own, number in zip((sign, last)[-len(node.args) :], node.args, strict=True):
            inner = self._graph.nodes[number]
            if self._uses[number] == 1 and (inner.op in _SUMS or self._is_opposite_sum(inner)):
                yield from self._terms(inner, own)
            else:
                yield own, number

    def _is_opposite_sum(self, node: Node) -> bool:
        """Whether a node is the negative of a sum that is used only here."""
        inner = node.args[0] if node.op == casadi.OP_NEG else -1
        return inner >= 0 and self._graph.nodes[inner].op in _SUMS and self._uses[inner] == 1


def _join(text: str, sign: int, term: str) -> str:
    """Return the text with which a term is appended to the text of a sum."""
    if not text:
        return f"-{term}" if sign < 0 else term
    return f" - {term}" if sign < 0 else f" + {term}"


def _uses(graph: Graph) -> list[int]:
    """Return the number of uses of each node by live nodes and results."""
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
    """Return S23 for the sine of q2 + q3, and sin(elbow) for other angles."""
    if re.fullmatch(r"q\d( \+ q\d)*", angle):
        return letter + "".join(re.findall(r"\d", angle))
    return {"S": "sin", "C": "cos"}[letter] + f"({angle})"


_WIDTH = 100
_PASSES = ("drop", "fold", "angles", "pythagoras")

_MEANING = {
    "type 2": "+ the root at a positive angle from the direction (X, Y), - the other",
}
"""Meaning of the sign of a step with a single sign, by kind of the step."""


def text(
    system: System,
    method: str = "auto",
    frame: str | int | None = None,
    locked: Mapping[str, float] | None = None,
) -> str:
    """Return the closed form of the inverse geometric model (inverse kinematics) as text.

    The text lists for each step the joints, the type of the equation, the equation, the meaning of
    its signs, and its coefficients. Coefficients depend on previous joints, on the elements T11 ..
    T34 of the pose and on the parameters. S1, C1 and S12 are the sine and cosine of q1 and the sine
    of q1 + q2.

    Args:
        system: open system, or a closed system whose tree contains the chain.
        method: "pieper", "paul", or "auto" for the cheaper of both.
        frame: name of a body or frame, index of a link, or None for the terminal frame.
        locked: positions of fixed joints, by name [rad or m].

    Raises:
        NoClosedForm: no closed form is known; the message gives the reason.
        ModelError: the method, frame or joint is unknown, or more than six joints are free.
    """
    chain = frame_chain(system, frame, locked)
    sequence, problem = sequence_of(chain, method), chain.problem()
    lines = [*_head(chain, sequence)]
    for number, one in enumerate(sequence.steps, 1):
        lines += ["", *_sheet(number, one, problem)]
    return "\n".join([*lines, "", *_branches(sequence)]) + "\n"


def _head(chain: FrameChain, sequence: StepSequence) -> Iterator[str]:
    system = chain.system
    yield f"Inverse geometric model of {system.name}: {', '.join(chain.names)} from the pose T of"
    yield f"frame {chain.frame!r} in the base; units are SI and radians"
    locked = ", ".join(f"{name} = {value:.12g}" for name, value in chain.locked.items())
    if locked:
        yield f"locked: {locked}"
    if system.parameters:
        yield f"parameters: {', '.join(parameter.name for parameter in system.parameters)}"
    yield f"steps: {len(sequence.steps)}, branches: {sequence.branches}"


def _sheet(number: int, one: SequenceStep, problem: Problem) -> Iterator[str]:
    yield f"{number}. {', '.join(one.names)}: {one.kind}"
    yield f"   {one.equation}"
    for name in one.signs:
        meaning = _MEANING.get(one.kind) if len(one.signs) == 1 else None
        yield f"   sign {name}: {meaning or '+ or -, a root each'}"
    if not one.coefficients:
        return
    s = casadi.vertcat(*(SX.sym(f"sign_{name}") for name in one.signs))
    values = one.function(problem.x, problem.given, SX(s))[3]
    inputs = {"x": problem.x, "given": problem.given, "s": SX(s)}
    function = Function("coefficients", [*inputs.values()], [values], [*inputs], ["c"])
    graph = graph_of(simplify(function, _PASSES, ()))
    names = {key: [str(value[k]) for k in range(value.numel())] for key, value in inputs.items()}
    for line in expression_lines(graph, names, one.coefficients, f"W{number}_"):
        yield from textwrap.wrap(
            line, _WIDTH, initial_indent="   ", subsequent_indent=" " * 7, break_long_words=False
        )


def _branches(sequence: StepSequence) -> Iterator[str]:
    if sequence.branches == 1:
        yield "There is one branch."
        return
    width = len(str(sequence.branches - 1))
    for number in range(sequence.branches):
        yield f"branch {number:{width}d}: {sequence.label(number)}"
