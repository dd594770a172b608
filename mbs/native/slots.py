"""Where values wait that one block of code computes and later ones need."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import casadi

from mbs.native.schedule import Step, gives, needs
from mbs.operations.graph import Graph

Leaving: TypeAlias = tuple[int, int, int]
"""An element of an output: number of the output, of the element in it, and of the node."""


@dataclass(frozen=True, slots=True)
class Slots:
    """Places in a work array.

    Attributes:
        of: place of each node that more than one block uses.
        outputs: for each computed node where it leaves: number of the output, of the element in
            it, and the node.
        moved: for each block the same of the inputs and constants that it copies.
        count: length of the array.
        blocks: number of blocks.
    """

    of: Mapping[int, int]
    outputs: Mapping[int, Sequence[Leaving]]
    moved: Mapping[int, Sequence[Leaving]]
    count: int
    blocks: int


def slots(
    graph: Graph,
    blocks: Sequence[Sequence[Step]],
    begins: Mapping[int, int] | None = None,
    elsewhere: Container[int] = (),
) -> Slots:
    """A place for each value that outlives its block, free again after its last use.

    Args:
        graph: what is computed.
        blocks: the steps.
        begins: of inputs that are not known from the beginning, the first block that has them.
        elsewhere: inputs, as nodes, that reach their outputs without a copy.
    """
    home = {n: k for k, steps in enumerate(blocks) for step in steps for n in gives(step)}
    of, count = _places(graph, blocks, home)
    outputs: dict[int, list[Leaving]] = {}
    moved: dict[int, list[Leaving]] = {}
    for k, nodes in enumerate(graph.results):
        for element, n in enumerate(nodes):
            if n in home:
                outputs.setdefault(n, []).append((k, element, n))
            elif n not in elsewhere:
                moved.setdefault(_first(graph, n, begins or {}), []).append((k, element, n))
    return Slots(of, outputs, moved, count, len(blocks))


def _places(
    graph: Graph, blocks: Sequence[Sequence[Step]], home: Mapping[int, int]
) -> tuple[dict[int, int], int]:
    """The place of each node that a later block than its own uses, and how many there are."""
    last: dict[int, int] = {}
    for k, steps in enumerate(blocks):
        for step in steps:
            last.update({n: k for n in needs(graph, step) if home.get(n, k) < k})
    starts: list[list[int]] = [[] for _ in blocks]
    ends: list[list[int]] = [[] for _ in blocks]
    for n in sorted(last):
        starts[home[n]].append(n)
        ends[last[n]].append(n)
    of: dict[int, int] = {}
    free: list[int] = []
    count = 0
    for k, entering in enumerate(starts):
        for n in entering:
            of[n] = free.pop() if free else count
            count += of[n] == count
        free += [of[n] for n in ends[k]]
    return of, count


def _first(graph: Graph, number: int, begins: Mapping[int, int]) -> int:
    """The first block that knows an input or constant."""
    node = graph.nodes[number]
    return begins.get(node.args[0], 0) if node.op == casadi.OP_INPUT else 0
