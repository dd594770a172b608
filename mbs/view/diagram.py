"""The picture of a connection graph: bodies as boxes, joints between them, cut joints dashed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from html import escape

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.errors import ExportError
from mbs.files import PathLike, path_of, write_text
from mbs.view.connections import connections
from mbs.view.diagram_layout import LETTER, LINE, PILL, Layout, PlacedEdge, PlacedNode, layout
from mbs.view.palette import PALETTE, Theme

_MARGIN, _TITLE, _FOOT = 26.0, 46.0, 40.0
_KEY = (("passive", "passive joint"), ("active", "driven joint"), ("loop", "cut to open a loop"))


@dataclass(frozen=True, slots=True)
class Diagram:
    """A picture of bodies and joints, as a notebook shows it.

    Attributes:
        svg: the text of an SVG file.
    """

    svg: str = field(repr=False)

    def _repr_svg_(self) -> str:
        return self.svg

    def save(self, path: PathLike) -> None:
        """Write an .svg file.

        Raises:
            ExportError: the ending is another one, or the file cannot be written.
        """
        if path_of(path).suffix.lower() != ".svg":
            raise ExportError(f"{path_of(path)}: a diagram is saved as .svg; change the ending")
        write_text(self.svg, path)


def diagram(system: System) -> Diagram:
    """The connection graph of a system: the spanning tree from the base downwards, and the cuts.

    Raises:
        ModelError: `system` is not a System.
    """
    require_system(system)
    graph = connections(system)
    placed = layout(graph)
    aside = sum(_rises(placed, pill) for pill in placed.cuts)
    width = max(
        placed.width + 14.0 * aside, 440.0, LETTER * max(map(len, graph.remarks), default=0)
    )
    total = width + 2 * _MARGIN
    top = _ascent(placed)
    room = 34.0 + 3.0 * len(graph.cuts) if graph.cuts else 14.0
    height = placed.height + top + _TITLE + _FOOT + room + LINE * len(graph.remarks)
    shift = (width - placed.width - 14.0 * aside) / 2 + _MARGIN
    body = [
        f'<text class="title" x="{_MARGIN}" y="28">{escape(_title(system))}</text>',
        f'<g transform="translate({shift:.1f} {_TITLE + top:.1f})">',
        *_wires(placed),
        *(_pill(edge) for edge in (*placed.tree, *placed.cuts)),
        *(_box(node) for node in placed.nodes.values()),
        "</g>",
        *_notes(graph.remarks, height),
    ]
    return Diagram(_document(total, height, body))


def drawn(system: System, path: PathLike | None) -> Diagram:
    """`diagram`, written to a file where one is named."""
    made = diagram(system)
    if path is not None:
        made.save(path)
    return made


def _ascent(placed: Layout) -> float:
    """How far the picture reaches above the middle of the base [px]."""
    box = placed.nodes[0].height / 2
    return max(box, *(PILL / 2 + 16 - pill.y for pill in placed.tree))


def _title(system: System) -> str:
    moving, loops = len(connections(system).nodes) - 1, len(system.cuts)
    count = f"{moving} moving bod{'y' if moving == 1 else 'ies'}"
    rest = f", {loops} loop{'s' if loops > 1 else ''}" if loops else ", no loop"
    mobility = system.closure.mobility if system.closure else system.nv
    return f"{system.name}: {count}{rest}, mobility {mobility}"


def _document(width: float, height: float, body: list[str]) -> str:
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
    base = placed.node.number == 0
    left, top = placed.x - placed.width / 2, placed.y - placed.height / 2
    rect = (
        f'<rect class="body{" base" if base else ""}" x="{left:.1f}" y="{top:.1f}"'
        f' width="{placed.width:.1f}" height="{placed.height:.1f}" rx="7"/>'
    )
    start = placed.y - LINE * (len(placed.node.lines) - 1) / 2 + 4.3
    kind = ' class="onbase"' if base else ""
    texts = (
        f'<text{kind} text-anchor="middle" x="{placed.x:.1f}" y="{start + LINE * k:.1f}">'
        f"{escape(line)}</text>"
        for k, line in enumerate(placed.node.lines)
    )
    return rect + "".join(texts)


def _pill(placed: PlacedEdge) -> str:
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
    for pill in placed.tree:
        first, second = (placed.nodes[end] for end in pill.edge.ends)
        yield _wire(_descent(first, pill))
        yield _wire(f"M{pill.x:.1f} {pill.y:.1f}L{second.x:.1f} {second.y:.1f}")
    entered: Counter[int] = Counter()
    risen = 0
    for pill in placed.cuts:
        owner, other = (placed.nodes[end] for end in pill.edge.ends)
        yield _wire(_descent(owner, pill), " open")
        if _rises(placed, pill):
            risen += 1
            yield _wire(_round(pill, other, placed.width + 14.0 * risen), " open")
        else:
            entered[other.node.number] += 1
            yield _wire(_across(pill, other, entered[other.node.number], placed), " open")


def _wire(path: str, more: str = "") -> str:
    return f'<path class="wire{more}" d="{path}"/>'


def _rises(placed: Layout, pill: PlacedEdge) -> bool:
    """Whether a cut joint leads back to a link above the one it hangs on."""
    owner, other = pill.edge.ends
    return other in placed.ancestors[owner]


def _descent(node: PlacedNode, pill: PlacedEdge) -> str:
    """From a link down to a joint below it, or over to the top of the next column."""
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


def _round(pill: PlacedEdge, other: PlacedNode, lane: float) -> str:
    """Along the right side of the picture up to a link."""
    foot, side = pill.y + PILL / 2, other.x + other.width / 2
    low = foot + 12
    return (
        f"M{pill.x:.1f} {foot:.1f}V{low - 8:.1f}q0 8 8 8H{lane - 8:.1f}q8 0 8 -8"
        f"V{other.y + 8:.1f}q0 -8 -8 -8H{side:.1f}"
    )


def _across(pill: PlacedEdge, other: PlacedNode, turn: int, placed: Layout) -> str:
    """Down from a joint and over to the bottom of a link, or to its side if others hang there."""
    foot = pill.y + PILL / 2
    busy = any(edge.edge.ends[0] == other.node.number for edge in (*placed.tree, *placed.cuts))
    if busy:
        way = 1 if pill.x > other.x else -1
        x, y = other.x + way * other.width / 2, other.y
        start, lane = pill.x - way * pill.width / 2, pill.x - way * (pill.width / 2 + 9)
        up, bend = (1 if y < pill.y else -1), 6 * way
        return (
            f"M{start:.1f} {pill.y:.1f}H{lane + bend:.1f}q{-bend} 0 {-bend} {-6 * up}"
            f"V{y + 6 * up:.1f}q0 {-6 * up} {-bend} {-6 * up}H{x:.1f}"
        )
    side = -1 if turn % 2 else 1
    x = other.x + side * min(7.0 * (turn // 2), 0.42 * other.width)
    y = other.y + other.height / 2
    low = max(foot, y) + 30 + 4 * turn
    return f"M{pill.x:.1f} {foot:.1f}C{pill.x:.1f} {low:.1f} {x:.1f} {low:.1f} {x:.1f} {y:.1f}"


def _notes(remarks: tuple[str, ...], height: float) -> Iterator[str]:
    """Couplings in words, and the key."""
    y = height - 18
    for k, remark in enumerate(remarks):
        row = y - 26 - LINE * (len(remarks) - 1 - k)
        yield f'<text class="small" x="{_MARGIN}" y="{row:.1f}">{escape(remark)}</text>'
    x = _MARGIN
    for kind, words in _KEY:
        shape = f'<rect class="pill {kind}" x="{x:.1f}" y="{y - 10:.1f}" width="22" height="13"'
        yield f'{shape} rx="6.5"/><text class="small" x="{x + 29:.1f}" y="{y:.1f}">{words}</text>'
        x += 29 + LETTER * len(words) + 18
