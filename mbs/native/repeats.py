"""Sequences of operations that recur in a graph, such as those of equal windows, legs or links.

C text holds such a sequence once, as a function that is called with a table of where its operands
are: its length, and the time of a compiler, follow the differences between the parts of a
mechanism, not their number. Operations are not reordered and not changed, so every value keeps its
bits.
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
"""Operations of a graph from which repeats are looked for: shorter ones compile in a second."""

_SHORTEST = 24  # operations of a sequence; shorter ones do not pay for their calls
_LONGEST = 1024  # of a sequence; longer ones are cut, which costs a call in a thousand operations
_NEAR = 16  # steps to an operand that every occurrence must have alike
_CALL = 8  # lines that one more occurrence costs: its call and its rows of tables
_HEAD = 8  # lines of a function beside its body

# Of the Jacobian of a Delta robot a quarter would be saved: it ran 1.15 times longer, and the
# compiler took as long. Where a third is saved it takes half as long at most.
_SHARE = 2 / 3  # of the lines that may be left

# Of a Stewart platform's dynamics sequences take and give 1.6 and 2.1 values and indices an
# operation: with them it runs 1.2 times longer. Those of chains and windows have 1.25 at most.
_ACCESSES = 1.25  # of memory per operation of a sequence
_BIG = 40_000  # operations beyond which straight lines leave the near caches, and calls are faster


class SeveralNodes(Protocol):
    """A step that computes several nodes at once."""

    def taken(self) -> tuple[int, ...]:
        """The nodes that must be known before."""

    def given(self) -> tuple[int, ...]:
        """The nodes that are known afterwards."""


S = TypeVar("S", bound=int | SeveralNodes)


class OccurrenceNodes(NamedTuple):
    """An operand of a sequence that it does not compute, or a result that others use.

    Attributes:
        node: of the graph of the sequence.
        nodes: for each occurrence, the node of the whole graph.
    """

    node: int
    nodes: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Repeat:
    """A sequence of operations that recurs.

    Attributes:
        graph: the sequence; its only input has the constants that differ, and OP_PARAMETER are
            values computed elsewhere.
        steps: the nodes of it to compute, in order.
        constants: operands that are constants but not always the same.
        taken: operands computed elsewhere, or inputs of the whole graph.
        given: results that others use.
        count: how often it occurs.
    """

    graph: Graph
    steps: tuple[int, ...]
    constants: tuple[OccurrenceNodes, ...]
    taken: tuple[OccurrenceNodes, ...]
    given: tuple[OccurrenceNodes, ...]
    count: int


@dataclass(frozen=True, slots=True, eq=False)
class Calls:
    """Occurrences of a sequence that follow each other.

    Attributes:
        repeat: the sequence.
        first: number of the first of them.
        count: of them.
    """

    repeat: Repeat
    first: int
    count: int

    def taken(self) -> tuple[int, ...]:
        """The nodes that must be known before."""
        own = set(self.given())
        span = slice(self.first, self.first + self.count)
        nodes = (node for column in self.repeat.taken for node in column.nodes[span])
        return tuple(node for node in dict.fromkeys(nodes) if node not in own)

    def given(self) -> tuple[int, ...]:
        """The nodes that are known afterwards."""
        return tuple(node for k in range(self.count) for node in self.gives(self.first + k))

    def gives(self, occurrence: int) -> tuple[int, ...]:
        """The nodes that are known after one occurrence."""
        return tuple(column.nodes[occurrence] for column in self.repeat.given)


def with_calls(graph: Graph, steps: Sequence[S], least: int = LEAST) -> list[S | Calls]:
    """The same steps, sequences that recur as `Calls`; as they are where that saves little.

    Args:
        graph: what is computed.
        steps: nodes, and groups of nodes, which are left as they are.
        least: operations from which repeats are looked for.
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
    """Steps whose sequences are replaced, those that follow each other by one step."""
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


# What recurs: sequences of equal operations, whose near operands are equally near.


def _tokens(graph: Graph, steps: Sequence[int | SeveralNodes]) -> list[Hashable]:
    """What a step must share with another one to stand in its place."""
    place = {step: k for k, step in enumerate(steps)}
    nodes = graph.nodes
    tokens: list[Hashable] = []
    for k, step in enumerate(steps):
        if not isinstance(step, int):
            tokens.append(k)  # unlike any other
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
    """Sequences that recur, none overlapping another, chosen so that much is saved.

    The sequence that saves most is taken first, then the one that saves most of the rest.

    Args:
        tokens: equal ones are exchangeable.

    Returns:
        of each the length and the places where it begins.
    """
    sorted_places, common = _sorted(tokens)
    heap = [
        (_CALL * (b - a + 1) - length * (b - a), length, a, b)
        for length, a, b in _intervals(common.tolist())
        if length * (b - a) > _CALL * (b - a + 1) + _HEAD
    ]
    heapq.heapify(heap)
    used = np.zeros(len(tokens) + 1, np.int64)  # how many steps before each one are taken
    chosen: list[tuple[int, tuple[int, ...]]] = []
    while heap:
        _, length, a, b = heapq.heappop(heap)
        places = np.sort(sorted_places[a : b + 1])
        saved, shorter, kept = max(
            (_kept(places, n, used) for n in _lengths(places, length)), key=lambda found: found[0]
        )
        if saved <= _HEAD:
            continue
        if heap and saved < -heap[0][0]:  # others save more: again after them
            heapq.heappush(heap, (-saved, length, a, b))
            continue
        chosen.append((shorter, tuple(kept)))
        marks = np.zeros(len(tokens) + 1, np.int64)
        for place in kept:
            marks[place + 1 : place + shorter + 1] = 1
        used += np.cumsum(marks)
    return chosen


def _lengths(places: Ints, length: int) -> list[int]:
    """A length, and those by which most occurrences that overlap would follow each other."""
    gaps = places[1:] - places[:-1]
    near = gaps[(gaps < length) & (gaps >= _SHORTEST)].tolist()
    return list(dict.fromkeys([length, mode(near), min(near)])) if near else [length]


def _kept(places: Ints, length: int, used: Ints) -> tuple[int, int, list[int]]:
    """The lines that a sequence saves, its length, and its places that nothing overlaps."""
    kept: list[int] = []
    end = -1
    for place in places[used[places + length] == used[places]].tolist():
        if place >= end:
            kept.append(place)
            end = place + length
    return length * (len(kept) - 1) - _CALL * len(kept), length, kept


def _sorted(tokens: Sequence[Hashable]) -> tuple[Ints, Ints]:
    """The places in the order of what follows them, and how far each agrees with the next one.

    Source: Manber & Myers 1993, by doubling; the lengths of agreement from the same ranks.
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
    """Length, first and last of every run of sorted places that agree so far, and no farther."""
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


# What a sequence takes and gives.


class _Order:
    """The steps of a graph, and where each node is computed and used."""

    def __init__(self, graph: Graph, steps: Sequence[int | SeveralNodes]) -> None:
        count = len(graph.nodes)
        self._graph = graph
        self._nodes = np.array([s if isinstance(s, int) else -1 for s in steps], np.int64)
        self._place = np.full(count, -1)  # of each node its step; -1 for what is no step of its own
        self._last = np.full(count, -1)  # of each node the last step that uses it
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
        """The sequence of a length that begins at these steps."""
        begins = np.array(places)[:, None]
        every = begins + np.arange(length)  # steps: a row for each occurrence
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
                own = np.flatnonzero((at >= 0) & (at < offset))  # its own, but not always the same
                stored[own, at[own]] = True
            within.add(self._graph.nodes[self._nodes[every[0, offset]]].op, operands)
        given = (
            OccurrenceNodes(within.steps[offset], tuple(self._nodes[every[:, offset]].tolist()))
            for offset in np.flatnonzero(stored.any(axis=0))
        )
        return within.repeat(tuple(given), len(places))

    def bases(self, repeat: Repeat) -> int:
        """How many indices an occurrence looks up, if results stand in the order of their steps."""
        columns = np.array([t.nodes for t in repeat.taken]).reshape(-1, repeat.count)
        steps = self._place[columns]
        places = np.where(steps < 0, columns - len(self._place), steps)
        return len({column.tobytes() for column in places - places[:, :1]}) + 1


class _Sequence:
    """The graph of a sequence in the making."""

    def __init__(self, graph: Graph) -> None:
        self.steps: list[int] = []
        self._whole = graph
        self._nodes: list[Node] = []
        self._constants: list[OccurrenceNodes] = []
        self._taken: list[OccurrenceNodes] = []
        self._known: dict[Hashable, int] = {}

    def add(self, op: int, operands: Sequence[int]) -> None:
        """The next operation."""
        self.steps.append(self._new(Node(op, tuple(operands))))

    def operand(self, nodes: tuple[int, ...]) -> int:
        """What every occurrence has of the whole graph, as a node of the sequence."""
        first = self._whole.nodes[nodes[0]]
        if first.op != casadi.OP_CONST:
            return self._once(nodes, Node(casadi.OP_PARAMETER), self._taken, nodes)
        # to the last bit, and zeros with their signs
        values = tuple(repr(self._whole.nodes[node].value) for node in nodes)
        if len(set(values)) == 1:
            return self._once(values, first, [], nodes)
        element = Node(casadi.OP_INPUT, (0, len(self._constants)))
        return self._once(values, element, self._constants, nodes)

    def repeat(self, given: tuple[OccurrenceNodes, ...], count: int) -> Repeat:
        """What has been made."""
        constants = Port("constants", Sparsity.dense(len(self._constants)))
        graph = Graph(self._whole.name, (constants,), (), tuple(self._nodes), ())
        own = tuple(self._constants), tuple(self._taken)
        return Repeat(graph, tuple(self.steps), *own, given, count)

    def _once(
        self, key: Hashable, node: Node, lists: list[OccurrenceNodes], nodes: tuple[int, ...]
    ) -> int:
        if key not in self._known:
            self._known[key] = self._new(node)
            lists.append(OccurrenceNodes(self._known[key], nodes))
        return self._known[key]

    def _new(self, node: Node) -> int:
        self._nodes.append(node)
        return len(self._nodes) - 1


# Where an occurrence finds what it takes, and leaves what it gives.


class CallTable(NamedTuple):
    """Indices of a work array, by occurrence.

    Attributes:
        texts: of each node of the sequence that it takes or gives the C text of its index, made of
            numbers and the elements of a row `at`.
        rows: for each occurrence.
    """

    texts: Mapping[int, str]
    rows: tuple[tuple[int, ...], ...]


def table_of(repeat: Repeat, place: Callable[[int], int]) -> CallTable:
    """The table of a sequence; indices that always differ by as much share one element of a row.

    Args:
        repeat: the sequence.
        place: of a node of the whole graph its index in the work array.
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
