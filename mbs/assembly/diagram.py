"""Diagram of the connection graph: bodies as boxes, joints between them, cut joints dashed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from html import escape

from mbs.assembly.report import followed
from mbs.assembly.system_data import SystemData
from mbs.errors import ExportError
from mbs.files import PathLike, path_of, write_text
from mbs.palette import PALETTE, Theme

# Connection graph of a system: rigid links (nodes) and joints (edges).


_KINDS = {
    "pointonline": "point on line",
    "pointonplane": "point on plane",
    "rollingdisc": "rolling disc",
    "constantvelocity": "constant velocity",
}
_MOST_NAMES = 3


@dataclass(frozen=True, slots=True)
class ConnectionNode:
    """Rigid link in a diagram.

    Attributes:
        number: number of the link, 0 for the base.
        lines: names of its bodies, one per line of text.
    """

    number: int
    lines: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ConnectionEdge:
    """Joint or constraint.

    Attributes:
        name: name of the joint.
        kind: kind of the joint as text.
        driven: whether the joint is actuated.
        cut: whether it closes a loop.
        ends: numbers of the two links. In the spanning tree, the link nearer to the base is first.
    """

    name: str
    kind: str
    driven: bool
    cut: bool
    ends: tuple[int, int]


@dataclass(frozen=True, slots=True)
class Connections:
    """Spanning tree of links, and the cut joints.

    Attributes:
        nodes: dict from link number to link.
        children: dict from link number to the joints of the tree on its distal side.
        cuts: joints that close loops.
        remarks: sentences on couplings of coordinates.
    """

    nodes: dict[int, ConnectionNode]
    children: dict[int, tuple[ConnectionEdge, ...]]
    cuts: tuple[ConnectionEdge, ...]
    remarks: tuple[str, ...]


def connections(system: SystemData) -> Connections:
    """Return the connection graph of a system: rigid links and the joints between them.

    Fixed joints are no edges, because the bodies that they join are one link.

    Args:
        system: assembled system.
    """
    edges = [_edge(system, k) for k, row in enumerate(system.joints) if row.part is None]
    edges = [edge for edge in edges if edge.ends[0] != edge.ends[1]]
    numbers = sorted({0, *(end for edge in edges for end in edge.ends)})
    children: dict[int, tuple[ConnectionEdge, ...]] = dict.fromkeys(numbers, ())
    reached, waiting = {0}, [0]
    for here in waiting:
        for edge in edges:
            if here in edge.ends and not edge.cut:
                there = sum(edge.ends) - here
                if there not in reached:
                    directed = ConnectionEdge(
                        edge.name, edge.kind, edge.driven, False, (here, there)
                    )
                    children[here] += (directed,)
                    reached.add(there)
                    waiting.append(there)
    nodes = {number: ConnectionNode(number, _names(system, number)) for number in numbers}
    return Connections(nodes, children, tuple(e for e in edges if e.cut), _remarks(system))


def _edge(system: SystemData, k: int) -> ConnectionEdge:
    """Return joint k of the system as an edge of the graph."""
    row = system.joints[k]
    speeds = (*system.velocity_coordinates, *system.cut_coordinates)
    driven = any(speed.actuated for speed in speeds if speed.joint == row.name)
    ends = row.frame_a[0] + 1, row.frame_b[0] + 1
    return ConnectionEdge(row.name, _KINDS.get(row.kind, row.kind), driven, row.cut, ends)


def _names(system: SystemData, number: int) -> tuple[str, ...]:
    """Return the lines of text of link `number`: names of its bodies, at most three lines."""
    if number == 0:
        return ("base",)
    names = [body.name for body in system.bodies if body.link == number]
    if len(names) > _MOST_NAMES:
        names = [*names[: _MOST_NAMES - 1], f"and {len(names) - _MOST_NAMES + 1} more"]
    return tuple(names) or (f"link {number}",)


def _remarks(system: SystemData) -> tuple[str, ...]:
    """Return a sentence for each coupling of coordinates."""
    return tuple(
        f"{loop.name}: {followed(loop.joints)}"
        for loop in system.loops
        if loop.closing == "coupling"
    )


# Layout of a connection graph: layers from the base downwards; a long chain is wrapped.
#
# A cut joint is a leaf below one of its links, with a line to its other link.


LINE, LETTER = 15.0, 6.9
"""Height of a line of text and width of a letter [px]."""

LEVEL = 104.0
"""Vertical distance of box middles [px]: boxes of three lines, with a joint label between."""
PILL = 21.0
"""Height of the label (pill) of a joint [px]: a line of text and a margin."""
_PAD, _GAP = 11.0, 18.0
"""Horizontal margin of a text in its box, and gap between two boxes [px]."""
_LONGEST = 8
"""Largest number of moving links of a chain in one column. Longer chains have more columns."""


@dataclass(frozen=True, slots=True)
class PlacedNode:
    """Link with position and size of its box.

    Attributes:
        node: the link.
        x, y: middle of the box [px], y downwards.
        width, height: size of the box [px].
    """

    node: ConnectionNode
    x: float
    y: float
    width: float
    height: float


@dataclass(frozen=True, slots=True)
class PlacedEdge:
    """Joint with the position of its label, below or next to its first link.

    Attributes:
        edge: the joint.
        x, y: middle of the label [px], y downwards.
        width: width of the label [px].
    """

    edge: ConnectionEdge
    x: float
    y: float
    width: float


@dataclass(frozen=True, slots=True)
class Layout:
    """Positions of links and joints in a diagram.

    Attributes:
        nodes: dict from link number to box.
        tree: labels of the joints of the spanning tree.
        cuts: labels of the cut joints.
        ancestors: dict from link number to the numbers of the links between it and the base.
        width, height: size of the picture [px].
    """

    nodes: dict[int, PlacedNode]
    tree: tuple[PlacedEdge, ...]
    cuts: tuple[PlacedEdge, ...]
    ancestors: dict[int, frozenset[int]]
    width: float
    height: float


def layout(graph: Connections) -> Layout:
    """Return the positions of all boxes and labels of a connection graph.

    Args:
        graph: links and joints.
    """
    hung = _cuts_below(graph)
    draft = _Layout(graph, hung, {}, [], [], {})
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
    """Return the link numbers of `graph` in order if it is one unbranched chain, else []."""
    here, found = 0, [0]
    while graph.children[here]:
        if len(graph.children[here]) > 1:
            return []
        here = graph.children[here][0].ends[1]
        found.append(here)
    return found


def _cuts_below(graph: Connections) -> dict[int, tuple[ConnectionEdge, ...]]:
    """Return for each link number of `graph` the cut joints to draw below it.

    A cut joint is drawn below the end link with fewer cut joints, and not below the base if
    possible.
    """
    count = Counter(end for edge in graph.cuts for end in edge.ends)
    depth = _depths(graph)
    hung: dict[int, tuple[ConnectionEdge, ...]] = dict.fromkeys(graph.nodes, ())
    for edge in graph.cuts:
        a, b = edge.ends
        owner = min((a, b), key=lambda n: (bool(n == 0), count[n], -depth[n]))
        other = b if owner == a else a
        directed = ConnectionEdge(edge.name, edge.kind, edge.driven, True, (owner, other))
        hung[owner] += (directed,)
    return hung


def _depths(graph: Connections) -> dict[int, int]:
    """Return the number of joints between the base and each link, by link number."""
    depth = dict.fromkeys(graph.nodes, 0)
    waiting = [0]
    for here in waiting:
        for edge in graph.children[here]:
            depth[edge.ends[1]] = depth[here] + 1
            waiting.append(edge.ends[1])
    return depth


def _text_width(text: str) -> float:
    """Return the width [px] of a text with horizontal margins."""
    return LETTER * len(text) + 2 * _PAD


def pill_width(edge: ConnectionEdge) -> float:
    """Return the width [px] of the label of a joint, a rounded rectangle with name and kind.

    Args:
        edge: the joint.
    """
    return _text_width(f"{edge.name}  {edge.kind}")


def _box_size(node: ConnectionNode) -> tuple[float, float]:
    """Return width and height [px] of the box of a link."""
    width = max(_text_width(line) for line in node.lines)
    # smallest width, for the word "base", and margins of 7 above and below the text [px]
    return max(width, 56.0), LINE * len(node.lines) + 14


@dataclass(frozen=True, slots=True)
class _Layout:
    """Layout under construction: positions of the parts that are placed.

    `hung` maps link numbers to the cut joints that are drawn below the link.
    """

    graph: Connections
    hung: dict[int, tuple[ConnectionEdge, ...]]
    nodes: dict[int, PlacedNode]
    tree: list[PlacedEdge]
    cuts: list[PlacedEdge]
    ancestors: dict[int, frozenset[int]]

    def width(self, number: int) -> float:
        """Return the width [px] of link `number` with all parts below it."""
        below = [self.branch(edge) for edge in self.graph.children[number]]
        below += [pill_width(edge) for edge in self.hung[number]]
        needed = sum(below) + _GAP * max(0, len(below) - 1)
        return max(_box_size(self.graph.nodes[number])[0], needed)

    def branch(self, edge: ConnectionEdge) -> float:
        """Return the width [px] of a joint with all parts below it.

        Args:
            edge: joint.
        """
        return max(pill_width(edge), self.width(edge.ends[1]))

    def place(self, number: int, left: float, y: float, above: frozenset[int]) -> None:
        """Place link `number` at height y and all parts below it, to the right of x = left [px].

        `above` are the numbers of its ancestors.
        """
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
        """Place the box of link `number` with its middle at (x, y) [px].

        `above` are the numbers of its ancestors.
        """
        node = self.graph.nodes[number]
        self.nodes[number] = PlacedNode(node, x, y, *_box_size(node))
        self.ancestors[number] = above

    def wrap(self, chain: list[int]) -> None:
        """Place the links of an unbranched chain in columns of similar length, top to bottom."""
        columns = -(-len(chain) // _LONGEST)
        rows = -(-len(chain) // columns)
        edges = [self.graph.children[number][0] for number in chain[:-1]]
        boxes = (_box_size(self.graph.nodes[edge.ends[1]])[0] for edge in edges)
        wide = max(*boxes, *map(pill_width, edges)) + 3 * _GAP
        for k, number in enumerate(chain):
            column, row = divmod(k, rows)
            x = (column + 0.5) * wide
            self.put(number, x, row * LEVEL, frozenset(chain[:k]))
            if k:
                edge = edges[k - 1]
                self.tree.append(PlacedEdge(edge, x, (row - 0.5) * LEVEL + 3, pill_width(edge)))


_MARGIN, _TITLE, _FOOT = 26.0, 46.0, 40.0
"""Margin around a diagram, height of its title, and height of the key below it [px]."""
_ASIDE = 14.0
"""Distance of two lines on the right side of a diagram [px]."""
_KEY = (("passive", "passive joint"), ("active", "driven joint"), ("loop", "cut to open a loop"))


@dataclass(frozen=True, slots=True)
class Diagram:
    """Diagram of bodies and joints, which a notebook displays.

    Attributes:
        svg: text of an SVG file.
    """

    svg: str = field(repr=False)

    def _repr_svg_(self) -> str:
        return self.svg

    def save(self, path: PathLike) -> None:
        """Write an .svg file.

        Args:
            path: path of the file.

        Raises:
            ExportError: the file extension is not .svg, or the file cannot be written.
        """
        if path_of(path).suffix.lower() != ".svg":
            raise ExportError(f"{path_of(path)}: a diagram is saved as .svg; change the ending")
        write_text(self.svg, path)


def diagram(system: SystemData) -> Diagram:
    """Draw the connection graph of a system as an SVG picture.

    The spanning tree runs from the base downwards; cut joints are dashed.

    Args:
        system: assembled system.
    """
    graph = connections(system)
    placed = layout(graph)
    aside = sum(_rises(placed, pill) for pill in placed.cuts)
    # smallest width: that of the key [px]
    width = max(
        placed.width + _ASIDE * aside, 440.0, LETTER * max(map(len, graph.remarks), default=0)
    )
    total = width + 2 * _MARGIN
    top = _ascent(placed)
    # height below the boxes for the lines of cut joints [px]
    room = 34.0 + 3.0 * len(graph.cuts) if graph.cuts else 14.0
    height = placed.height + top + _TITLE + _FOOT + room + LINE * len(graph.remarks)
    shift = (width - placed.width - _ASIDE * aside) / 2 + _MARGIN
    body = [
        f'<text class="title" x="{_MARGIN}" y="28">{escape(_title(system))}</text>',
        f'<g transform="translate({shift:.1f} {_TITLE + top:.1f})">',
        *_wires(placed),
        *(_joint_label(edge) for edge in (*placed.tree, *placed.cuts)),
        *(_box(node) for node in placed.nodes.values()),
        "</g>",
        *_notes(graph.remarks, height),
    ]
    return Diagram(_document(total, height, body))


def drawn(system: SystemData, path: PathLike | None) -> Diagram:
    """Return the diagram of a system, and write it to a file.

    Args:
        system: assembled system.
        path: path of the .svg file; None to write no file.

    Raises:
        ExportError: the file extension is not .svg, or the file cannot be written.
    """
    made = diagram(system)
    if path is not None:
        made.save(path)
    return made


def _ascent(placed: Layout) -> float:
    """Return the height of the picture above the middle of the base [px]."""
    box = placed.nodes[0].height / 2
    return max(box, *(PILL / 2 + 16 - pill.y for pill in placed.tree))


def _title(system: SystemData) -> str:
    """Return the title: name, number of bodies and loops, and mobility."""
    moving, loops = len(connections(system).nodes) - 1, len(system.cuts)
    count = f"{moving} moving bod{'y' if moving == 1 else 'ies'}"
    rest = f", {loops} loop{'s' if loops > 1 else ''}" if loops else ", no loop"
    mobility = system.closure.mobility if system.closure else system.nv
    return f"{system.name}: {count}{rest}, mobility {mobility}"


def _document(width: float, height: float, body: list[str]) -> str:
    """Return the text of an SVG file of this size [px], with the elements `body`."""
    size = f'width="{width:.0f}" height="{height:.0f}" viewBox="0 0 {width:.0f} {height:.0f}"'
    look = [
        *_style("light"),
        "@media (prefers-color-scheme: dark) {",
        *_style("dark"),
        "}",
    ]
    head = f'<svg xmlns="http://www.w3.org/2000/svg" class="mbs-diagram" {size}>'
    paper = '<rect class="paper" width="100%" height="100%" rx="8"/>'
    return "\n".join([head, "<style>", *look, "</style>", paper, *body, "</svg>"]) + "\n"


def _style(theme: Theme) -> Iterator[str]:
    """Yield the CSS rules of a theme."""
    colours = PALETTE[theme]
    paint = {name: str(colours[name]) for name in ("background", "text", "base", "active", "loop")}
    soft = "#ffffff" if theme == "light" else "#232932"
    rules = {
        ".paper": f"fill: {paint['background']}",
        "text": f"fill: {paint['text']}; font: 12.5px system-ui, sans-serif",
        ".title": "font-weight: 600; font-size: 14px",
        ".small": "font-size: 11.5px",
        ".name": "font-weight: 600",
        ".body": f"fill: {soft}; stroke: {colours['link0']}; stroke-width: 1.6",
        ".base": f"fill: {paint['base']}; stroke: none",
        ".onbase": "fill: #ffffff; font-weight: 600",
        ".wire": f"fill: none; stroke: {colours['joint']}; stroke-width: 1.8",
        ".open": f"stroke: {paint['loop']}; stroke-dasharray: 6 4",
        ".pill": f"fill: {paint['background']}; stroke: {colours['joint']}; stroke-width: 1.4",
        ".active": f"fill: {paint['active']}; stroke: {paint['active']}",
        ".onactive": "fill: #1c1405",
        ".loop": f"stroke: {paint['loop']}; stroke-dasharray: 6 4",
    }
    for name, rule in rules.items():
        yield f"  .mbs-diagram {name} {{ {rule} }}"


def _box(placed: PlacedNode) -> str:
    """Return the SVG text of the box of the placed link."""
    base = placed.node.number == 0
    left, top = placed.x - placed.width / 2, placed.y - placed.height / 2
    rect = (
        f'<rect class="body{" base" if base else ""}" x="{left:.1f}" y="{top:.1f}"'
        f' width="{placed.width:.1f}" height="{placed.height:.1f}" rx="7"/>'
    )
    # 4.3 px: distance from the middle of letters to their baseline
    start = placed.y - LINE * (len(placed.node.lines) - 1) / 2 + 4.3
    kind = ' class="onbase"' if base else ""
    texts = (
        f'<text{kind} text-anchor="middle" x="{placed.x:.1f}" y="{start + LINE * k:.1f}">'
        f"{escape(line)}</text>"
        for k, line in enumerate(placed.node.lines)
    )
    return rect + "".join(texts)


def _joint_label(placed: PlacedEdge) -> str:
    """Return the SVG text of the label of the placed joint, a rounded rectangle with its name."""
    edge = placed.edge
    look = f"{' active' if edge.driven else ''}{' loop' if edge.cut else ''}"
    left, top = placed.x - placed.width / 2, placed.y - PILL / 2
    inside = " onactive" if edge.driven else ""
    return (
        f'<rect class="pill{look}" x="{left:.1f}" y="{top:.1f}" width="{placed.width:.1f}"'
        f' height="{PILL}" rx="{PILL / 2}"/>'
        f'<text class="small{inside}" text-anchor="middle" x="{placed.x:.1f}"'
        f' y="{placed.y + 4:.1f}"><tspan class="name">{escape(edge.name)}</tspan>'
        f" {escape(edge.kind)}</text>"
    )


def _wires(placed: Layout) -> Iterator[str]:
    """Yield the SVG paths from links to joints, and of the cut joints."""
    for pill in placed.tree:
        first, second = (placed.nodes[end] for end in pill.edge.ends)
        yield _wire(_path_down(first, pill))
        yield _wire(f"M{pill.x:.1f} {pill.y:.1f}L{second.x:.1f} {second.y:.1f}")
    entered: Counter[int] = Counter()
    risen = 0
    for pill in placed.cuts:
        owner, other = (placed.nodes[end] for end in pill.edge.ends)
        yield _wire(_path_down(owner, pill), " open")
        if _rises(placed, pill):
            risen += 1
            yield _wire(_path_beside(pill, other, placed.width + _ASIDE * risen), " open")
        else:
            entered[other.node.number] += 1
            yield _wire(_path_to_bottom(pill, other, entered[other.node.number], placed), " open")


def _wire(path: str, more: str = "") -> str:
    """Return the SVG text of a line; `more` are further CSS classes."""
    return f'<path class="wire{more}" d="{path}"/>'


def _rises(placed: Layout, pill: PlacedEdge) -> bool:
    """Whether the second link of cut joint `pill` is an ancestor of the link it is drawn below."""
    owner, other = pill.edge.ends
    return other in placed.ancestors[owner]


def _path_down(node: PlacedNode, pill: PlacedEdge) -> str:
    """Return the SVG path from a link `node` to a joint `pill` below it or in the next column."""
    foot = node.y + node.height / 2
    if pill.y > foot:
        bend = (foot + pill.y - PILL / 2) / 2
        curve = f"C{node.x:.1f} {bend:.1f} {pill.x:.1f} {bend:.1f}"
        return f"M{node.x:.1f} {foot:.1f}{curve} {pill.x:.1f} {pill.y - PILL / 2:.1f}"
    side, middle = node.x + node.width / 2, (node.x + pill.x) / 2
    top = pill.y - PILL / 2
    return (
        f"M{side:.1f} {node.y:.1f}H{middle - 8:.1f}q8 0 8 -8V{top - 6:.1f}"
        f"q0 -8 8 -8H{pill.x - 8:.1f}q8 0 8 8V{top:.1f}"
    )


def _path_beside(pill: PlacedEdge, other: PlacedNode, lane: float) -> str:
    """Return the SVG path from a cut joint along the right side (x = lane) up to link `other`.

    `pill` is the cut joint; all lengths are in px.
    """
    foot, side = pill.y + PILL / 2, other.x + other.width / 2
    low = foot + 12
    return (
        f"M{pill.x:.1f} {foot:.1f}V{low - 8:.1f}q0 8 8 8H{lane - 8:.1f}q8 0 8 -8"
        f"V{other.y + 8:.1f}q0 -8 -8 -8H{side:.1f}"
    )


def _path_to_bottom(pill: PlacedEdge, other: PlacedNode, order: int, placed: Layout) -> str:
    """Return the SVG path from a cut joint to the bottom of link `other`.

    It ends at the side of the link if joints are drawn below it. `order` is the number of such
    lines to this link, from 1.

    `pill` is the cut joint.
    """
    foot = pill.y + PILL / 2
    busy = any(edge.edge.ends[0] == other.node.number for edge in (*placed.tree, *placed.cuts))
    if busy:
        sign = 1 if pill.x > other.x else -1
        x, y = other.x + sign * other.width / 2, other.y
        start, lane = pill.x - sign * pill.width / 2, pill.x - sign * (pill.width / 2 + 9)
        up, bend = (1 if y < pill.y else -1), 6 * sign
        return (
            f"M{start:.1f} {pill.y:.1f}H{lane + bend:.1f}q{-bend} 0 {-bend} {-6 * up}"
            f"V{y + 6 * up:.1f}q0 {-6 * up} {-bend} {-6 * up}H{x:.1f}"
        )
    # lines end left and right of the middle of a box, 7 px apart, and not at its corners
    side = -1 if order % 2 else 1
    # 42 % of the width is just inside the corner
    x = other.x + side * min(7.0 * (order // 2), 0.42 * other.width)
    y = other.y + other.height / 2
    low = max(foot, y) + 30 + 4 * order
    return f"M{pill.x:.1f} {foot:.1f}C{pill.x:.1f} {low:.1f} {x:.1f} {low:.1f} {x:.1f} {y:.1f}"


def _notes(remarks: tuple[str, ...], height: float) -> Iterator[str]:
    """Yield SVG texts of the couplings (`remarks`) and of the legend, at the bottom of a picture.

    `height` is that of the picture [px].
    """
    y = height - 18
    for k, remark in enumerate(remarks):
        row = y - 26 - LINE * (len(remarks) - 1 - k)
        yield f'<text class="small" x="{_MARGIN}" y="{row:.1f}">{escape(remark)}</text>'
    x = _MARGIN
    for kind, words in _KEY:
        shape = f'<rect class="pill {kind}" x="{x:.1f}" y="{y - 10:.1f}" width="22" height="13"'
        yield f'{shape} rx="6.5"/><text class="small" x="{x + 29:.1f}" y="{y:.1f}">{words}</text>'
        x += 29 + LETTER * len(words) + 18
