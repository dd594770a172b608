"""Division of a graph into lines of code: nodes with a line, and nodes inside expressions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import casadi

from mbs.operations.graph import Graph, Node

LONGEST = 72
"""Approximate length of an expression [characters] above which a part of it gets its own line."""

LEAVES = frozenset({casadi.OP_CONST, casadi.OP_INPUT})
COMPARISONS = frozenset({casadi.OP_LT, casadi.OP_LE, casadi.OP_EQ, casadi.OP_NE})
CONNECTIVES = frozenset({casadi.OP_AND, casadi.OP_OR, casadi.OP_NOT})
CONDITIONS = COMPARISONS | CONNECTIVES
_COMMUTATIVE = frozenset({casadi.OP_ADD, casadi.OP_MUL, casadi.OP_EQ, casadi.OP_NE})
_PLAIN = frozenset(
    {
        *(casadi.OP_ADD, casadi.OP_SUB, casadi.OP_MUL, casadi.OP_DIV, casadi.OP_INV),
        *(casadi.OP_NEG, casadi.OP_TWICE, casadi.OP_SQRT, casadi.OP_EXP, casadi.OP_LOG),
        *(casadi.OP_SIN, casadi.OP_COS, casadi.OP_TAN, casadi.OP_TANH, casadi.OP_FABS),
        *(casadi.OP_ASIN, casadi.OP_ACOS, casadi.OP_ATAN, casadi.OP_ATAN2),
        *CONDITIONS,
    }
)
"""Operations with arbitrary expressions as operands. Others need names or constants."""

_NAME, _NUMBER, _SIGNS = 4, 8, 3


class Choice(NamedTuple):
    """Conditional value of a node, given by node indices.

    Attributes:
        condition: condition.
        value: value if the condition holds.
        otherwise: value if it does not hold; None for zero.
    """

    condition: int
    value: int
    otherwise: int | None


@dataclass(frozen=True, slots=True)
class LinePlan:
    """Graph with the nodes that become lines of code.

    Attributes:
        graph: graph without duplicate nodes.
        fixed: nodes of lines that depend only on constants and parameters.
        changing: nodes of all other lines.
        choices: dict from node to conditional value, for lines with a condition.
    """

    graph: Graph
    fixed: tuple[int, ...]
    changing: tuple[int, ...]
    choices: Mapping[int, Choice]


def arrange(graph: Graph, first: Iterable[int] = ()) -> tuple[Graph, dict[int, int]]:
    """Return a graph without duplicate and unused nodes, ordered by the first use of nodes.

    Args:
        graph: graph of scalar operations.
        first: indices of nodes to compute first, each after its operands. Results follow.

    Returns:
        New graph, and the new index by old index of the nodes in it.
    """
    roots = [*first, *(number for result in graph.results for number in result)]
    nodes: list[Node] = []
    known: dict[Node, int] = {}
    new: dict[int, int] = {}
    stack = [(root, False) for root in reversed(roots)]
    while stack:
        number, ready = stack.pop()
        if number in new:
            continue
        operands = graph.operands(number)
        if not ready:
            stack.append((number, True))
            stack.extend((operand, False) for operand in reversed(operands))
            continue
        node = graph.nodes[number]
        args = tuple(new[k] for k in operands) if operands else node.args
        if node.op == casadi.OP_ASSIGN:
            new[number] = args[0]
            continue
        if node.op in _COMMUTATIVE:
            args = tuple(sorted(args))
        node = Node(node.op, args, node.value)
        if node not in known:
            known[node] = len(nodes)
            nodes.append(node)
        new[number] = known[node]
    return graph.with_nodes(nodes, [[new[k] for k in result] for result in graph.results]), new


def plan_of(graph: Graph, named: Iterable[int], parameters: Iterable[str] = ("p",)) -> LinePlan:
    """Return the division of a graph into lines of code.

    Lines are nodes with a name, nodes used more than once, conditional values, and parts of long
    expressions.

    Args:
        graph: graph from `arrange`. Results are lines, unless they are inputs or constants.
        named: indices of nodes that have a name.
        parameters: names of inputs that are constant between calls. Expressions of parameters only
            get separate lines.
    """
    choices = {n: c for n in range(len(graph.nodes)) if (c := _choice(graph, n))}
    results = {number for result in graph.results for number in result}
    cuts = {n for n in (*named, *results) if graph.nodes[n].op not in LEAVES}
    fixed = graph.fixed_by(parameters)
    draft = _LinesSoFar(graph, choices, fixed, cuts)
    draft.count_uses(results)
    draft.shorten()
    lines = sorted(n for n in draft.cuts if draft.uses[n])
    return LinePlan(
        graph,
        tuple(n for n in lines if fixed[n]),
        tuple(n for n in lines if not fixed[n]),
        {n: choices[n] for n in lines if n in choices},
    )


def _choice(graph: Graph, number: int) -> Choice | None:
    """Return the conditional value of a node, or None.

    CasADi writes if-else as the sum of two values with opposite conditions.
    """
    node = graph.nodes[number]
    if node.op == casadi.OP_IF_ELSE_ZERO:
        return Choice(node.args[0], node.args[1], None)
    if node.op != casadi.OP_ADD:
        return None
    one, other = (graph.nodes[k] for k in node.args)
    if one.op != casadi.OP_IF_ELSE_ZERO or other.op != casadi.OP_IF_ELSE_ZERO:
        return None
    for yes, no in ((one, other), (other, one)):
        if graph.nodes[no.args[0]] == Node(casadi.OP_NOT, (yes.args[0],)):
            return Choice(yes.args[0], yes.args[1], no.args[1])
    return None


@dataclass(slots=True)
class _LinesSoFar:
    """State of the search for lines.

    Attributes:
        graph: graph from `arrange`.
        choices: conditional values by node.
        fixed: whether each node depends only on parameters.
        cuts: nodes that become lines.
        uses: number of uses of each node as a value.
        tests: number of uses of each node as a condition.
    """

    graph: Graph
    choices: Mapping[int, Choice]
    fixed: Sequence[bool]
    cuts: set[int]
    uses: list[int] = field(default_factory=list)
    tests: list[int] = field(default_factory=list)

    def count_uses(self, results: Iterable[int]) -> None:
        """Count the uses from the results to the inputs. Nodes used more than once become lines."""
        self.uses = [0] * len(self.graph.nodes)
        self.tests = [0] * len(self.graph.nodes)
        for number in results:
            self.uses[number] = 1
        for number in reversed(range(len(self.graph.nodes))):
            if self.uses[number] or self.tests[number]:
                self._add_line_if_needed(number)
                self._pass_on(number)

    def _add_line_if_needed(self, number: int) -> None:
        """Make a node a line if it is used repeatedly, or is a condition or conditional value."""
        op = self.graph.nodes[number].op
        if op in LEAVES or not self.uses[number]:
            return
        repeated = self.uses[number] > 1 and op != casadi.OP_NEG
        if repeated or op in CONDITIONS or number in self.choices:
            self.cuts.add(number)

    def _pass_on(self, number: int) -> None:
        """Count the uses of the operands of a node."""
        node, times = self.graph.nodes[number], 1
        if node.op == casadi.OP_NEG and number not in self.cuts:
            times = self.uses[number]
        if node.op in CONDITIONS:
            times = self.tests[number] + (self.uses[number] > 0)
        choice = self.choices.get(number)
        if choice:
            self._test(choice.condition, 1)
            operands = [k for k in choice[1:] if k is not None]
        else:
            operands = list(self.graph.operands(number))
        for operand in operands:
            if node.op in CONNECTIVES:
                self._test(operand, times)
                continue
            self.uses[operand] += times
            if self._stands_alone(number, operand):
                self.cuts.add(self._bare(operand))

    def _test(self, number: int, times: int) -> None:
        """Count `times` uses of a node as a condition, or as a value if it is no condition."""
        tally = self.tests if self.graph.nodes[number].op in CONDITIONS else self.uses
        tally[number] += times

    def _stands_alone(self, number: int, operand: int) -> bool:
        """Whether an operand of a node must be a line.

        This is so if the operation needs a name, or if the operand alone depends only on
        parameters.
        """
        bare = self._bare(operand)
        if self.graph.nodes[bare].op in LEAVES:
            return False
        hoisted = self.fixed[bare] and not self.fixed[number]
        return hoisted or (self.graph.nodes[number].op not in _PLAIN and number not in self.choices)

    def _bare(self, number: int) -> int:
        """Return the node without leading negations that are not lines."""
        while self.graph.nodes[number].op == casadi.OP_NEG and number not in self.cuts:
            number = self.graph.nodes[number].args[0]
        return number

    def shorten(self) -> None:
        """Make parts of long expressions lines until each expression is at most LONGEST."""
        length = [0] * len(self.graph.nodes)
        for number, node in enumerate(self.graph.nodes):
            if not (self.uses[number] or self.tests[number]):
                continue
            if node.op in LEAVES:
                length[number] = _NUMBER if node.op == casadi.OP_CONST else _NAME
                continue
            operands = [k for k in self._operands(number) if k is not None]
            own = sum(length[k] + _SIGNS for k in operands)
            for operand in sorted(operands, key=lambda k: -length[k]):
                bare = self._bare(operand)
                if own > LONGEST and length[operand] > _NUMBER + 1 and self.uses[bare]:
                    self.cuts.add(bare)
                    own -= length[operand] - _NAME
            length[number] = _NAME if number in self.cuts else own

    def _operands(self, number: int) -> Sequence[int | None]:
        """Return the operands of a node, or the parts of a conditional value."""
        return self.choices.get(number) or self.graph.operands(number)
