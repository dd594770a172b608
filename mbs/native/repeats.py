"""Sequences of operations that recur in a graph, such as the operations of equal links.

C code contains such a sequence once, as a function that is called with a table of the indices of
its operands. The length and the compile time of the code thus depend on the number of different
parts of a mechanism, not on the number of all parts. Operations are neither reordered nor changed,
so every value is bit-identical.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import mode
from typing import Any, NamedTuple, Protocol, TypeVar

import casadi
import numpy as np
from casadi import Sparsity

from mbs.operations.graph import Graph, Node, Port

Ints = np.ndarray[Any, np.dtype[np.int64]]

LEAST = 4000
"""Number of operations from which repeats are searched: shorter code compiles in one second."""

_SHORTEST = 24  # operations of a sequence; a shorter sequence does not repay its calls
_LONGEST = 1024  # operations of a sequence; longer sequences are cut: a call per 1000 operations
_NEAR = 16  # steps back to an operand up to which the distance is equal in every occurrence
_CALL = 8  # lines that a call costs: the call itself and its rows of tables
_HEAD = 8  # lines of a C function without its body

# The Jacobian of a Delta robot would become a quarter shorter, but ran 1.15 times longer and took
# as long to compile. If a third of the lines is saved, compilation takes half as long at most.
_SHARE = 2 / 3  # largest fraction of the lines that may remain

# Sequences in the dynamics of a Stewart platform read and write 1.6 and 2.1 values and indices per
# operation and make it 1.2 times slower. Sequences of chains and windows have 1.25 at most.
_ACCESSES = 1.25  # largest number of memory accesses per operation of a sequence
_BIG = 40_000  # operations beyond which straight code exceeds the near caches; calls are faster


class SeveralNodes(Protocol):
    """Interface of a step that computes several nodes at once."""

    def taken(self) -> tuple[int, ...]:
        """Return the node indices of the operands."""

    def given(self) -> tuple[int, ...]:
        """Return the node indices of the results."""


S = TypeVar("S", bound=int | SeveralNodes)


class OccurrenceNodes(NamedTuple):
    """Node of a sequence and its equivalent node in each occurrence.

    The node is an operand that is computed outside the sequence, or a result that is used outside.

    Attributes:
        node: index of the node in the graph of the sequence.
        nodes: index of the node in the whole graph, for each occurrence.
    """

    node: int
    nodes: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Repeat:
    """Sequence of operations that recurs in a graph.

    Attributes:
        graph: graph of the sequence. Its only input contains the constants that differ between
            occurrences. Nodes with OP_PARAMETER are values that are computed outside.
        steps: indices of the nodes of `graph` to compute, in order.
        constants: operands that are constants with different values.
        taken: operands that are computed outside the sequence, or inputs of the whole graph.
        given: results that are used outside the sequence.
        count: number of occurrences.
    """

    graph: Graph
    steps: tuple[int, ...]
    constants: tuple[OccurrenceNodes, ...]
    taken: tuple[OccurrenceNodes, ...]
    given: tuple[OccurrenceNodes, ...]
    count: int


@dataclass(frozen=True, slots=True, eq=False)
class Calls:
    """Consecutive occurrences of a sequence.

    Attributes:
        repeat: recurring sequence.
        first: index of the first occurrence.
        count: number of occurrences.
    """

    repeat: Repeat
    first: int
    count: int

    def taken(self) -> tuple[int, ...]:
        """Return the indices of the nodes that must be computed before."""
        own = set(self.given())
        span = slice(self.first, self.first + self.count)
        nodes = (node for column in self.repeat.taken for node in column.nodes[span])
        return tuple(node for node in dict.fromkeys(nodes) if node not in own)

    def given(self) -> tuple[int, ...]:
        """Return the indices of the nodes that the occurrences compute."""
        return tuple(node for k in range(self.count) for node in self.gives(self.first + k))

    def gives(self, occurrence: int) -> tuple[int, ...]:
        """Return the indices of the nodes that a single occurrence computes.

        Args:
            occurrence: index of the occurrence.
        """
        return tuple(column.nodes[occurrence] for column in self.repeat.given)


def with_calls(graph: Graph, steps: Sequence[S], least: int = LEAST) -> list[S | Calls]:
    """Return the steps with recurring sequences replaced by `Calls`.

    The steps are unchanged if that saves few lines of C.

    Args:
        graph: operation graph.
        steps: indices of nodes, and groups of nodes, which are never part of a sequence.
        least: number of steps from which repeats are searched.
    """
    if len(steps) < least:
        return [*steps]
    order = _Order(graph, steps)
    found: list[tuple[Repeat, tuple[int, ...]]] = []
    left = len(steps)
    for length, places in recurring(_tokens(graph, steps)):
        repeat = order.repeat(length, places)
        bases = order.bases(repeat)
        accesses = len(repeat.taken) + len(repeat.given) + len(repeat.constants) + bases
        function = length + len(repeat.taken) + len(repeat.given) + _HEAD
        saved = (length - 1 - (bases + len(repeat.constants)) // 8) * repeat.count - function
        if saved > 0 and (len(steps) > _BIG or accesses <= _ACCESSES * length):
            found.append((repeat, places))
            left -= saved
    return _replaced(steps, found) if left < _SHARE * len(steps) else [*steps]


def _replaced(
    steps: Sequence[S], found: Iterable[tuple[Repeat, tuple[int, ...]]]
) -> list[S | Calls]:
    """Return the steps with the sequences `found` replaced by `Calls`.

    `found` are pairs of a sequence and the indices of the steps where it starts. Consecutive
    occurrences become a single step.
    """
    starts = {place: (r, k) for r, places in found for k, place in enumerate(places)}
    result: list[S | Calls] = []
    k = 0
    while k < len(steps):
        if k not in starts:
            result.append(steps[k])
            k += 1
            continue
        (repeat, first), count = starts[k], 0
        while starts.get(k, (None, 0))[0] is repeat:
            count, k = count + 1, k + len(repeat.steps)
        result.append(Calls(repeat, first, count))
    return result


# Search for sequences of equal operations whose near operands are at equal distances.


def _tokens(graph: Graph, steps: Sequence[int | SeveralNodes]) -> list[Hashable]:
    """Return a token per step: steps with equal tokens can be part of equal sequences."""
    place = {step: k for k, step in enumerate(steps)}
    nodes = graph.nodes
    tokens: list[Hashable] = []
    for k, step in enumerate(steps):
        if not isinstance(step, int):
            tokens.append(k)  # a group of nodes differs from all other steps
            continue
        words = [nodes[step].op]
        for operand in nodes[step].args:
            if nodes[operand].op == casadi.OP_CONST:
                words.append(-1)
            else:
                distance = k - place.get(operand, -len(steps))
                words.append(distance if distance <= _NEAR else 0)
        tokens.append(tuple(words))
    return tokens


def recurring(tokens: Sequence[Hashable]) -> list[tuple[int, tuple[int, ...]]]:
    """Return recurring sequences that do not overlap, chosen greedily by the lines they save.

    Args:
        tokens: token of each step; steps with equal tokens are interchangeable.

    Returns:
        the length and the start indices of each sequence.
    """
    sorted_places, common = _sorted(tokens)
    heap = [
        (_CALL * (b - a + 1) - length * (b - a), length, a, b)
        for length, a, b in _intervals(common.tolist())
        if length * (b - a) > _CALL * (b - a + 1) + _HEAD
    ]
    heapq.heapify(heap)
    used = np.zeros(len(tokens) + 1, np.int64)  # steps before each step that sequences contain
    chosen: list[tuple[int, tuple[int, ...]]] = []
    while heap:
        _, length, a, b = heapq.heappop(heap)
        places = np.sort(sorted_places[a : b + 1])
        saved, shorter, kept = max(
            (_kept(places, n, used) for n in _lengths(places, length)), key=lambda found: found[0]
        )
        if saved <= _HEAD:
            continue
        if heap and saved < -heap[0][0]:  # other sequences save more: try this sequence again later
            heapq.heappush(heap, (-saved, length, a, b))
            continue
        chosen.append((shorter, tuple(kept)))
        marks = np.zeros(len(tokens) + 1, np.int64)
        for place in kept:
            marks[place + 1 : place + shorter + 1] = 1
        used += np.cumsum(marks)
    return chosen


def _lengths(places: Ints, length: int) -> list[int]:
    """Return candidate lengths of a sequence that occurs at `places` with at most this length.

    They are the length itself, and distances of overlapping occurrences.
    """
    gaps = places[1:] - places[:-1]
    near = gaps[(gaps < length) & (gaps >= _SHORTEST)].tolist()
    return list(dict.fromkeys([length, mode(near), min(near)])) if near else [length]


def _kept(places: Ints, length: int, used: Ints) -> tuple[int, int, list[int]]:
    """Return the saved lines, the length, and the start indices of occurrences without overlap.

    `used` counts the steps before each step that are part of chosen sequences already.

    `places` are the start indices of all occurrences, `length` is the number of steps.
    """
    kept: list[int] = []
    end = -1
    for place in places[used[places + length] == used[places]].tolist():
        if place >= end:
            kept.append(place)
            end = place + length
    return length * (len(kept) - 1) - _CALL * len(kept), length, kept


def _sorted(tokens: Sequence[Hashable]) -> tuple[Ints, Ints]:
    """Return the suffix array of the tokens, and the common prefix length of its neighbours.

    Lengths are limited by `_LONGEST`. Source: Manber & Myers 1993, prefix doubling. The common
    prefix lengths follow from the same ranks.
    """
    numbers: dict[Hashable, int] = {}
    count = len(tokens)
    ranks = [np.array([numbers.setdefault(t, len(numbers)) for t in tokens], np.int64)]
    width = 1
    while width < _LONGEST:
        later = np.zeros(count, np.int64)
        later[: max(count - width, 0)] = ranks[-1][width:] + 1
        ranks.append(np.unique(ranks[-1] * (count + 1) + later, return_inverse=True)[1])
        width *= 2
    order = np.argsort(ranks[-1], kind="stable")
    a, b = order[:-1], order[1:]
    common = np.zeros(max(count - 1, 0), np.int64)
    for rank in reversed(ranks):
        inside = np.flatnonzero((np.maximum(a, b) + common + width <= count) & (common < _LONGEST))
        at = common[inside]
        equal = rank[a[inside] + at] == rank[b[inside] + at]
        common[inside[equal]] += width
        width //= 2
    return order, common


def _intervals(common: Sequence[int]) -> list[tuple[int, int, int]]:
    """Return (length, first, last) of each maximal range of suffixes with a common prefix.

    `common` are the common prefix lengths of neighbours in the suffix array.
    """
    found: list[tuple[int, int, int]] = []
    open_ones: list[tuple[int, int]] = []
    for k, length in enumerate([*common, 0]):
        first = k
        while open_ones and open_ones[-1][0] > length:
            longer, first = open_ones.pop()
            found.append((longer, first, k))
        if length >= _SHORTEST and (not open_ones or open_ones[-1][0] < length):
            open_ones.append((length, first))
    return found


# Operands and results of a sequence.


class _Order:
    """Steps of a graph, with the step that computes each node and the last step that uses it."""

    def __init__(self, graph: Graph, steps: Sequence[int | SeveralNodes]) -> None:
        count = len(graph.nodes)
        self._graph = graph
        self._nodes = np.array([s if isinstance(s, int) else -1 for s in steps], np.int64)
        self._place = np.full(count, -1)  # step that computes each node alone; -1 if there is none
        self._last = np.full(count, -1)  # last step that uses each node
        self._operands = np.full((2, len(steps)), -1)
        for k, step in enumerate(steps):
            if isinstance(step, int):
                self._place[step] = k
                for j, operand in enumerate(graph.nodes[step].args):
                    self._operands[j, k] = operand
                    self._last[operand] = k
            else:
                self._last[list(step.taken())] = k
        for result in graph.results:
            self._last[list(result)] = len(steps)

    def repeat(self, length: int, places: Sequence[int]) -> Repeat:
        """Return the recurring sequence of `length` steps that starts at each step of `places`."""
        begins = np.array(places)[:, None]
        every = begins + np.arange(length)  # indices of steps, one row per occurrence
        within = _Sequence(self._graph)
        stored = self._last[self._nodes[every]] >= begins + length
        for offset in range(length):
            operands = []
            for nodes in self._operands[:, every[:, offset]]:
                if nodes[0] < 0:
                    break
                at = self._place[nodes] - begins[:, 0]
                if 0 <= at[0] < offset and np.all(at == at[0]):
                    operands.append(within.steps[at[0]])
                    continue
                operands.append(within.operand(tuple(nodes.tolist())))
                own = np.flatnonzero((at >= 0) & (at < offset))  # inside only some occurrences
                stored[own, at[own]] = True
            within.add(self._graph.nodes[self._nodes[every[0, offset]]].op, operands)
        given = (
            OccurrenceNodes(within.steps[offset], tuple(self._nodes[every[:, offset]].tolist()))
            for offset in np.flatnonzero(stored.any(axis=0))
        )
        return within.repeat(tuple(given), len(places))

    def bases(self, repeat: Repeat) -> int:
        """Return the number of indices per occurrence of a sequence, with results in step order.

        Args:
            repeat: recurring sequence.
        """
        columns = np.array([t.nodes for t in repeat.taken]).reshape(-1, repeat.count)
        steps = self._place[columns]
        places = np.where(steps < 0, columns - len(self._place), steps)
        return len({column.tobytes() for column in places - places[:, :1]}) + 1


class _Sequence:
    """Graph of a sequence under construction."""

    def __init__(self, graph: Graph) -> None:
        self.steps: list[int] = []
        self._whole = graph
        self._nodes: list[Node] = []
        self._constants: list[OccurrenceNodes] = []
        self._taken: list[OccurrenceNodes] = []
        self._known: dict[Hashable, int] = {}

    def add(self, op: int, operands: Sequence[int]) -> None:
        """Append an operation with CasADi code `op`; the operands are nodes of the sequence."""
        self.steps.append(self._new(Node(op, tuple(operands))))

    def operand(self, nodes: tuple[int, ...]) -> int:
        """Return the sequence node for one node of the whole graph per occurrence.

        It is a constant if all values are equal, else an element of the table of constants or a
        value that is computed outside.
        """
        first = self._whole.nodes[nodes[0]]
        if first.op != casadi.OP_CONST:
            return self._once(nodes, Node(casadi.OP_PARAMETER), self._taken, nodes)
        # compare bit patterns, including the sign of zero
        values = tuple(repr(self._whole.nodes[node].value) for node in nodes)
        if len(set(values)) == 1:
            return self._once(values, first, [], nodes)
        element = Node(casadi.OP_INPUT, (0, len(self._constants)))
        return self._once(values, element, self._constants, nodes)

    def repeat(self, given: tuple[OccurrenceNodes, ...], count: int) -> Repeat:
        """Return the completed sequence, with its results `given` and the number of occurrences.

        Args:
            given: nodes of the results.
            count: number of occurrences.
        """
        constants = Port("constants", Sparsity.dense(len(self._constants)))
        graph = Graph(self._whole.name, (constants,), (), tuple(self._nodes), ())
        own = tuple(self._constants), tuple(self._taken)
        return Repeat(graph, tuple(self.steps), *own, given, count)

    def _once(
        self, key: Hashable, node: Node, lists: list[OccurrenceNodes], nodes: tuple[int, ...]
    ) -> int:
        """Return the node that is known by `key`; otherwise add `node` and append it to `lists`."""
        if key not in self._known:
            self._known[key] = self._new(node)
            lists.append(OccurrenceNodes(self._known[key], nodes))
        return self._known[key]

    def _new(self, node: Node) -> int:
        """Append a node and return its index."""
        self._nodes.append(node)
        return len(self._nodes) - 1


# Indices of operands and results of each occurrence.


class CallTable(NamedTuple):
    """Work array indices of the operands and results of a sequence.

    Attributes:
        texts: node of the sequence to the C text of its index: a number, plus an element of the
            row `at` if the index varies between occurrences.
        rows: row `at` of each occurrence.
    """

    texts: Mapping[int, str]
    rows: tuple[tuple[int, ...], ...]


def table_of(repeat: Repeat, place: Callable[[int], int]) -> CallTable:
    """Return the index table of a sequence.

    Nodes whose indices have a constant difference in all occurrences share an element of a row.

    Args:
        repeat: recurring sequence.
        place: callable from a node of the whole graph to its index in the work array.
    """
    columns = {t.node: [place(n) for n in t.nodes] for t in (*repeat.given, *repeat.taken)}
    texts: dict[int, str] = {}
    bases: dict[tuple[int, ...], int] = {}
    for node, column in columns.items():
        least = min(column)
        beyond = tuple(k - least for k in column)
        if any(beyond):
            texts[node] = f"at[{bases.setdefault(beyond, len(bases))}] + {least}"
        else:
            texts[node] = str(least)
    return CallTable(texts, tuple(zip(*bases, strict=True)) if bases else ((),) * repeat.count)
