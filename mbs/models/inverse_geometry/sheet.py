"""The closed form of a robot as a sheet to read: joint after joint, its equation and its roots."""

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

# Scalar expressions as lines that people read, what is used twice under a name of its own.


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
        """The product of all numbers, then the other factors in their order."""
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
            text += _join(text, sign, term)
        if constant or not text:
            text += _join(text, -1 if constant < 0 else 1, f"{abs(constant):.12g}")
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


def _join(text: str, sign: int, term: str) -> str:
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


_WIDTH = 100
_PASSES = ("drop", "fold", "angles", "pythagoras")

_MEANING = {
    "type 2": "+ the root at a positive angle from the direction (X, Y), - the other",
}
"""Of the sign of a step with one, by its kind."""


def text(
    system: System,
    method: str = "auto",
    frame: str | int | None = None,
    locked: Mapping[str, float] | None = None,
) -> str:
    """The closed form of the inverse geometric model, to be read.

    For every step: the joints that it gives, the type of its equation, the equation, what its
    signs choose between, and the coefficients, in terms of the joints found before, of the
    elements T11 .. T34 of the pose and of the parameters. S1, C1, S12 are the sine and cosine of
    q1 and the sine of q1 + q2.

    Args:
        system: whose model it is.
        method: "pieper", "paul", or "auto" for the cheaper of them.
        frame: a body, a named frame, the number of a link, or None for the terminal frame.
        locked: positions of joints that stay where they are, by name [rad or m].

    Raises:
        NoClosedForm: no closed form is known; the message says what stood in the way.
        ModelError: there is no such method, frame or joint, or more than six joints are free.
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
