"""Which joints carry the tree, and which are cut to open the loops."""

from __future__ import annotations

import heapq
from collections.abc import Collection
from dataclasses import dataclass

from mbs.assembly.graph import BodyGraph, Edge
from mbs.errors import AssemblyError


@dataclass(frozen=True, slots=True, eq=False)
class Branch:
    """A joint of the tree, run through from the node nearer to the base.

    Attributes:
        edge: the joint.
        parent, child: nodes before and after it; the child is -1 for the free end of a joint
            that had to stay in the tree although it closes a loop.
        forward: whether frame_a is on the side of the base.
    """

    edge: Edge
    parent: int
    child: int
    forward: bool


@dataclass(frozen=True, slots=True, eq=False)
class SpanningTree:
    """Branches in the order in which links are numbered, and the joints that close loops."""

    branches: tuple[Branch, ...]
    cuts: tuple[Edge, ...]


def spanning_tree(
    name: str,
    graph: BodyGraph,
    *,
    need: Collection[str] = (),
    keep: Collection[str] = (),
    cut: Collection[str] = (),
    given_order: bool = False,
) -> SpanningTree:
    """A spanning tree that keeps driven joints, cuts the freest passive ones, and stays shallow.

    Prim's algorithm from the world: among the joints that reach a new body, the one that is
    least wanted as a cut comes first, then the one with the fewest freedoms, then the one nearest
    to the base, which keeps loops short. Least wanted is a passive joint whose coordinate
    something refers to, then a driven or guessed one, then any other; a driven joint that is cut
    keeps its coordinate. Constraints, which place nothing, are always cut.

    Args:
        name: of the mechanism, for messages.
        graph: nodes and joints.
        need: joints whose coordinates couplings and forces refer to.
        keep: joints that a user guessed a position for.
        cut: joints that the description itself cuts.
        given_order: number links in the order of the joints instead of depth-first.

    Raises:
        AssemblyError: a body cannot be reached from the world, or only by a joint to be cut.
    """
    chosen = _prim(graph, set(need), set(keep), set(cut))
    reached = {0} | {edge.a for edge in chosen} | {edge.b for edge in chosen}
    for number in range(len(graph.nodes)):
        if number not in reached:
            raise AssemblyError(_unreached(name, graph, number))
    for edge in chosen:
        if edge.joint.name in cut:
            raise AssemblyError(
                f"{name}: joint {edge.joint.name!r} cannot be cut, since nothing else connects what"
                " it carries to the world; take this cut away"
            )
    cuts = tuple(edge for edge in graph.edges if edge not in chosen)
    branches = _depth_first(graph, chosen)
    if given_order:
        branches = _in_given_order(graph, branches)
    return SpanningTree(tuple(branches), cuts)


def _unreached(name: str, graph: BodyGraph, number: int) -> str:
    """That nothing places a node, and what to do."""
    holders = [e.joint for e in graph.edges if number in (e.a, e.b) and not e.joint.places]
    where = f"{name}: no chain of joints leads from the world to {graph.nodes[number].name!r}"
    if holders:
        joint = holders[0]
        return (
            f"{where}: {type(joint).__name__} {joint.name!r} constrains it but does not place it;"
            " connect it to the world by a Free joint, too"
        )
    return f"{where}; connect it, or connect it to the world by a Free joint"


def _prim(graph: BodyGraph, need: set[str], keep: set[str], cut: set[str]) -> list[Edge]:
    depth = {0: 0}
    chosen: list[Edge] = []
    queue: list[tuple[tuple[bool, int, int, int, int], int]] = []

    def offer(node: int) -> None:
        for number, edge in enumerate(graph.edges):
            joint = edge.joint
            if joint.places and node in (edge.a, edge.b):
                driven = joint.carries_effort
                wanted = driven or joint.name in need or joint.name in keep
                rank = 0 if joint.name in need and not driven else 1 if wanted else 2
                key = (joint.name in cut, rank, joint.nv, depth[node], number)
                heapq.heappush(queue, (key, number))

    offer(0)
    while queue:
        _, number = heapq.heappop(queue)
        edge = graph.edges[number]
        new = [node for node in (edge.a, edge.b) if node not in depth]
        if new:
            (node,) = new
            depth[node] = 1 + min(depth[n] for n in (edge.a, edge.b) if n in depth)
            chosen.append(edge)
            offer(node)
    return chosen


def _depth_first(graph: BodyGraph, chosen: list[Edge]) -> list[Branch]:
    branches: list[Branch] = []
    rank = {id(edge): number for number, edge in enumerate(graph.edges)}
    ordered = sorted(chosen, key=lambda edge: rank[id(edge)])
    seen = {0}
    stack = [iter(_branches_from(0, ordered))]
    while stack:
        branch = next(stack[-1], None)
        if branch is None:
            stack.pop()
        elif branch.child not in seen:
            seen.add(branch.child)
            branches.append(branch)
            stack.append(iter(_branches_from(branch.child, ordered)))
    return branches


def _branches_from(node: int, edges: list[Edge]) -> list[Branch]:
    return [
        Branch(edge, node, edge.b if edge.a == node else edge.a, edge.a == node)
        for edge in edges
        if node in (edge.a, edge.b)
    ]


def _in_given_order(graph: BodyGraph, branches: list[Branch]) -> list[Branch]:
    """The branches by the order of their joints, as far as antecedents allow."""
    rank = {edge.joint.name: number for number, edge in enumerate(graph.edges)}
    waiting = sorted(branches, key=lambda branch: rank[branch.edge.joint.name])
    reached, ordered = {0}, []
    while waiting:
        branch = next(b for b in waiting if b.parent in reached)
        waiting.remove(branch)
        reached.add(branch.child)
        ordered.append(branch)
    return ordered
