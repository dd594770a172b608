"""Where values wait that one block of code computes and later ones need."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass

from mbs.native.schedule import Step, gives, needs
from mbs.operations.graph import Graph


@dataclass(frozen=True, slots=True)
class Slots:
    """Places in a work array.

    Attributes:
        of: place of each node that more than one block uses.
        outputs: for each node, and under None for all inputs and constants, where it leaves:
            number of the output, of the element in it, and the node.
        count: length of the array.
        blocks: number of blocks.
    """

    of: Mapping[int, int]
    outputs: Mapping[int | None, Sequence[tuple[int, int, int]]]
    count: int
    blocks: int


def slots(graph: Graph, blocks: Sequence[Sequence[Step]]) -> Slots:
    """A place for each value that outlives its block, free again after its last use."""
    home = {n: k for k, steps in enumerate(blocks) for step in steps for n in gives(step)}
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
    for k, begins in enumerate(starts):
        for n in begins:
            of[n] = free.pop() if free else count
            count += of[n] == count
        free += [of[n] for n in ends[k]]
    return Slots(of, _outputs(graph, home), count, len(blocks))


def _outputs(
    graph: Graph, computed: Container[int]
) -> dict[int | None, list[tuple[int, int, int]]]:
    result: dict[int | None, list[tuple[int, int, int]]] = {}
    for k, nodes in enumerate(graph.results):
        for element, n in enumerate(nodes):
            result.setdefault(n if n in computed else None, []).append((k, element, n))
    return result
