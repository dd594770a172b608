"""Where the parts of a connection graph go: layers from the base downwards, a long chain wrapped.

A joint that was cut hangs as a leaf below one of its links; a line leads from it to the other.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from mbs.view.connections import ConnectionEdge, ConnectionNode, Connections

LINE, LETTER = 15.0, 6.9
"""Height of a line of text and width of a letter [px]."""

LEVEL = 104.0
PILL = 21.0
_PAD, _GAP = 11.0, 18.0
_LONGEST = 8
"""A chain of more links than this goes on beside itself."""


@dataclass(frozen=True, slots=True)
class PlacedNode:
    """A link: the middle of its box, and its size [px]."""

    node: ConnectionNode
    x: float
    y: float
    width: float
    height: float


@dataclass(frozen=True, slots=True)
class PlacedEdge:
    """A joint: the middle of its pill, and its width [px]; below or beside the first link."""

    edge: ConnectionEdge
    x: float
    y: float
    width: float


@dataclass(frozen=True, slots=True)
class Layout:
    """Links, joints of the tree and cut joints, in a picture of this width and height [px]."""

    nodes: dict[int, PlacedNode]
    tree: tuple[PlacedEdge, ...]
    cuts: tuple[PlacedEdge, ...]
    ancestors: dict[int, frozenset[int]]
    width: float
    height: float


def layout(graph: Connections) -> Layout:
    """Places for a graph."""
    hung = _hung(graph)
    draft = _DiagramSoFar(graph, hung, {}, [], [], {})
    chain = _chain(graph) if not graph.cuts else []
    if len(chain) > _LONGEST + 1:
        draft.wrap(chain)
    else:
        draft.place(0, 0.0, 0.0, frozenset())
    boxes = [(n.x, n.width, n.y + n.height / 2) for n in draft.nodes.values()]
    pills = [(e.x, e.width, e.y + PILL / 2) for e in (*draft.tree, *draft.cuts)]
    right = max(x + width / 2 for x, width, _ in boxes + pills)
    bottom = max(y for _, _, y in boxes + pills)
    placed = tuple(draft.tree), tuple(draft.cuts)
    return Layout(draft.nodes, *placed, draft.ancestors, right, bottom)


def _chain(graph: Connections) -> list[int]:
    """The links one after the other where none branches; empty where one does."""
    here, found = 0, [0]
    while graph.children[here]:
        if len(graph.children[here]) > 1:
            return []
        here = graph.children[here][0].ends[1]
        found.append(here)
    return found


def _hung(graph: Connections) -> dict[int, tuple[ConnectionEdge, ...]]:
    """For each link the cut joints that hang below it: the link that fewer of them join."""
    count = Counter(end for edge in graph.cuts for end in edge.ends)
    depth = _depths(graph)
    hung: dict[int, tuple[ConnectionEdge, ...]] = dict.fromkeys(graph.nodes, ())
    for edge in graph.cuts:
        a, b = edge.ends
        owner = min((a, b), key=lambda n: (bool(n == 0), count[n], -depth[n]))
        other = b if owner == a else a
        turned = ConnectionEdge(edge.name, edge.kind, edge.driven, True, (owner, other))
        hung[owner] += (turned,)
    return hung


def _depths(graph: Connections) -> dict[int, int]:
    depth = dict.fromkeys(graph.nodes, 0)
    waiting = [0]
    for here in waiting:
        for edge in graph.children[here]:
            depth[edge.ends[1]] = depth[here] + 1
            waiting.append(edge.ends[1])
    return depth


def _text_width(text: str) -> float:
    return LETTER * len(text) + 2 * _PAD


def pill_width(edge: ConnectionEdge) -> float:
    """Width of the pill of a joint [px]."""
    return _text_width(f"{edge.name}  {edge.kind}")


def _box(node: ConnectionNode) -> tuple[float, float]:
    width = max(_text_width(line) for line in node.lines)
    return max(width, 56.0), LINE * len(node.lines) + 14


@dataclass(frozen=True, slots=True)
class _DiagramSoFar:
    """What is placed so far."""

    graph: Connections
    hung: dict[int, tuple[ConnectionEdge, ...]]
    nodes: dict[int, PlacedNode]
    tree: list[PlacedEdge]
    cuts: list[PlacedEdge]
    ancestors: dict[int, frozenset[int]]

    def width(self, number: int) -> float:
        """Of a link with all that is below it."""
        below = [self.branch(edge) for edge in self.graph.children[number]]
        below += [pill_width(edge) for edge in self.hung[number]]
        needed = sum(below) + _GAP * max(0, len(below) - 1)
        return max(_box(self.graph.nodes[number])[0], needed)

    def branch(self, edge: ConnectionEdge) -> float:
        """Width of a joint with all that is below it."""
        return max(pill_width(edge), self.width(edge.ends[1]))

    def place(self, number: int, left: float, y: float, above: frozenset[int]) -> None:
        """Put a link, and all below it, to the right of an edge."""
        wide = self.width(number)
        self.put(number, left + wide / 2, y, above)
        edges = self.graph.children[number]
        widths = [self.branch(e) for e in edges] + [pill_width(e) for e in self.hung[number]]
        start = left + (wide - sum(widths) - _GAP * max(0, len(widths) - 1)) / 2
        for edge, width in zip((*edges, *self.hung[number]), widths, strict=True):
            middle = start + width / 2
            pill = PlacedEdge(edge, middle, y + LEVEL / 2 + 3, pill_width(edge))
            if edge.cut:
                self.cuts.append(pill)
            else:
                self.tree.append(pill)
                inner = start + (width - self.width(edge.ends[1])) / 2
                self.place(edge.ends[1], inner, y + LEVEL, above | {number})
            start += width + _GAP

    def put(self, number: int, x: float, y: float, above: frozenset[int]) -> None:
        """Put a link."""
        node = self.graph.nodes[number]
        self.nodes[number] = PlacedNode(node, x, y, *_box(node))
        self.ancestors[number] = above

    def wrap(self, chain: list[int]) -> None:
        """Put a chain in columns of like length, each from top to bottom."""
        columns = -(-len(chain) // _LONGEST)
        rows = -(-len(chain) // columns)
        edges = [self.graph.children[number][0] for number in chain[:-1]]
        wide = max(self.branch_alone(edge) for edge in edges) + 3 * _GAP
        for k, number in enumerate(chain):
            column, row = divmod(k, rows)
            x = (column + 0.5) * wide
            self.put(number, x, row * LEVEL, frozenset(chain[:k]))
            if k:
                edge = edges[k - 1]
                self.tree.append(PlacedEdge(edge, x, (row - 0.5) * LEVEL + 3, pill_width(edge)))

    def branch_alone(self, edge: ConnectionEdge) -> float:
        """Width of a joint with the link below it."""
        return max(pill_width(edge), _box(self.graph.nodes[edge.ends[1]])[0])
