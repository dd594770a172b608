"""The order in which machine code computes a graph: its angles first, then block after block."""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import TypeAlias

import casadi

from mbs.operations.graph import Graph

LANES = 8
"""Angles whose sines and cosines are computed at once."""

_ONE_PIECE = 4000  # operations that compilers digest at once, and better so
_BATCH_SIZE = 50  # as many operations take a compiler as long

_FREE = (casadi.OP_INPUT, casadi.OP_CONST)


@dataclass(frozen=True, slots=True)
class Batch:
    """Sines and cosines computed at once.

    Attributes:
        angles: the nodes they are of, at most LANES.
        results: for each node that is a sine (lane) or cosine (LANES + lane) of them its place.
    """

    angles: tuple[int, ...]
    results: tuple[tuple[int, int], ...]


Step: TypeAlias = int | Batch
"""A node to compute by its own operation, or a batch."""


def schedule(graph: Graph, phase: Sequence[int] | None = None) -> list[Step]:
    """Every step that the outputs need, each after what it needs.

    Angles made of inputs alone come first, all their sines and cosines at once; angles made of
    those next, and so on; then all that remains, in the order of the graph.

    Args:
        graph: what to compute.
        phase: of each node, as `phases` tells; nodes of different phases share no batch.
    """
    phase = phase or [0] * len(graph.nodes)
    pending = graph.live()
    for number, node in enumerate(graph.nodes):
        pending[number] = pending[number] and node.op not in _FREE
    steps: list[Step] = []
    for batches in _batches(graph, pending, phase):
        angles = [angle for batch in batches for angle in batch.angles]
        steps += _take(_ancestors(graph, angles, pending), pending)
        for batch in batches:
            steps.append(batch)
            for number, _ in batch.results:
                pending[number] = False
    return [*steps, *_take(range(len(graph.nodes)), pending)]


def plain_order(graph: Graph) -> list[Step]:
    """Every node that the outputs need and that is computed, in the order of the graph."""
    live = graph.live()
    return [k for k, node in enumerate(graph.nodes) if live[k] and node.op not in _FREE]


def phases(graph: Graph, late: Mapping[int, int]) -> list[int]:
    """For each node the phase in which it can be computed.

    Args:
        graph: has the nodes.
        late: of inputs that are not known from the beginning, the phase from which they are.
    """
    phase: list[int] = []
    for number, node in enumerate(graph.nodes):
        if node.op == casadi.OP_INPUT:
            phase.append(late.get(node.args[0], 0))
        else:
            phase.append(max((phase[k] for k in graph.operands(number)), default=0))
    return phase


def blocks(graph: Graph, steps: Sequence[Step], size: int) -> list[list[Step]]:
    """Steps in pieces of about `size` operations, or in one if they are few enough for that."""
    leaves = Counter(number for result in graph.results for number in result)
    ends = list(accumulate(_weight(step) + sum(leaves[n] for n in gives(step)) for step in steps))
    total = ends[-1] if ends else 0
    one = total <= _ONE_PIECE and leaves.total() <= size
    pieces = 1 if one else round(total / size) or 1
    cuts = [bisect_right(ends, total * k // pieces) for k in range(pieces)]
    return [list(steps[a:b]) for a, b in pairwise([*cuts, len(steps)])]


def _weight(step: Step) -> int:
    return _BATCH_SIZE if isinstance(step, Batch) else 1


def needs(graph: Graph, step: Step) -> tuple[int, ...]:
    """The nodes that must be known before a step."""
    return step.angles if isinstance(step, Batch) else graph.operands(step)


def gives(step: Step) -> tuple[int, ...]:
    """The nodes that are known after a step."""
    return tuple(n for n, _ in step.results) if isinstance(step, Batch) else (step,)


def _take(numbers: Iterable[int], pending: list[bool]) -> list[int]:
    """Those of the numbers that are pending, which they are no longer."""
    taken = [number for number in numbers if pending[number]]
    for number in taken:
        pending[number] = False
    return taken


def _ancestors(graph: Graph, numbers: Iterable[int], pending: Sequence[bool]) -> list[int]:
    """These nodes and those they are made of, as far as they are not computed yet."""
    wanted: set[int] = set()
    stack = list(numbers)
    while stack:
        number = stack.pop()
        if pending[number] and number not in wanted:
            wanted.add(number)
            stack += graph.operands(number)
    return sorted(wanted)


def _batches(graph: Graph, alive: Sequence[bool], phase: Sequence[int]) -> list[list[Batch]]:
    """The batches, those first that need no others."""
    depth = [0] * len(graph.nodes)
    levels: dict[tuple[int, int], dict[int, list[tuple[int, int]]]] = {}
    for number, node in enumerate(graph.nodes):
        operands = graph.operands(number)
        depth[number] = max((depth[k] for k in operands), default=0)
        if node.op in (casadi.OP_SIN, casadi.OP_COS) and alive[number]:
            part = 0 if node.op == casadi.OP_SIN else LANES
            angles = levels.setdefault((phase[number], depth[number]), {})
            angles.setdefault(operands[0], []).append((number, part))
            depth[number] += 1
    return [_split(levels[level]) for level in sorted(levels)]


def _split(angles: dict[int, list[tuple[int, int]]]) -> list[Batch]:
    result = []
    every = list(angles.items())
    for k in range(0, len(every), LANES):
        some = every[k : k + LANES]
        places = [
            (number, part + lane) for lane, (_, uses) in enumerate(some) for number, part in uses
        ]
        result.append(Batch(tuple(angle for angle, _ in some), tuple(places)))
    return result
