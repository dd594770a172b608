"""A drawing as SVG text."""

from __future__ import annotations

from html import escape

from mbs.export.fmu.figure import Figure, Label, Point, Stroke, bounds
from mbs.export.fmu.labels import SIZE

_LETTER = 0.6  # width of a letter in heights, for the room that labels need
_MARGIN = 4.0
_LEAST = (80.0, 30.0)  # width and height of a drawing that holds little

_SHAPES = """\
.drawing path { fill: none; stroke-width: 0.5; stroke-linejoin: round; stroke-linecap: round; }
.drawing .link { stroke-width: 1.5; }
.drawing .area { fill-opacity: 0.25; }
.drawing .joint.area, .drawing .closing.area, .drawing .mass { fill-opacity: 1; }
.drawing .axis { stroke-width: 0.3; stroke-dasharray: 1.4 0.8 0.3 0.8; }
.drawing text { font: 3.2px sans-serif; }
.drawing .halo { stroke-width: 0.9; stroke-linejoin: round; }
"""
_LIGHT = ("#1f2d3d", "#6d88a3", "#fbfbf8", "#b5480c", "#2c7a4b", "#7b8088", "#2456a8")
_DARK = ("#d7e0ea", "#6b8bab", "#14181d", "#f0955a", "#6cc08b", "#8d95a0", "#86b0f2")


def _colours(palette: tuple[str, ...]) -> str:
    line, link, body, closing, force, quiet, frame = palette
    rules = (
        ("path.link", f"stroke: {link}"),
        ("path.link.area", f"fill: {link}"),
        ("path.joint", f"stroke: {line}; fill: {body}"),
        ("path.closing", f"stroke: {closing}; fill: {body}"),
        ("path.axis, .drawing path.ground", f"stroke: {quiet}"),
        ("path.force", f"stroke: {force}"),
        ("path.frame", f"stroke: {frame}"),
        ("path.mass", f"fill: {line}; stroke: none"),
        ("text", f"fill: {line}"),
        ("text.halo", f"fill: {body}; stroke: {body}"),
        ("text.link", f"fill: {quiet}"),
        ("text.closing", f"fill: {closing}"),
        ("text.frame", f"fill: {frame}"),
        ("text.force", f"fill: {force}"),
    )
    return "".join(f".drawing {which} {{ {what}; }}\n" for which, what in rules)


LIGHT = _SHAPES + _colours(_LIGHT)
"""Style sheet of a drawing on a light page."""

STYLE = LIGHT + "@media (prefers-color-scheme: dark) {\n" + _colours(_DARK) + "}\n"
"""Style sheet of a drawing on a page that follows the reader's choice of light or dark."""


def svg(figure: Figure, title: str, style: str = STYLE) -> str:
    """The element `svg` of a drawing.

    Args:
        figure: what to draw.
        title: what it is, for those who do not see it.
        style: `STYLE`, or `LIGHT` where nothing follows the reader's choice.
    """
    left, lower, right, upper = _room(figure)
    width, height = right - left, upper - lower
    lines = [
        f'<svg class="drawing" xmlns="http://www.w3.org/2000/svg" role="img"'
        f' viewBox="0 0 {width:.2f} {height:.2f}">',
        f"<title>{escape(title)}</title>",
        f"<style>\n{style}</style>",
        *(_path(stroke, left, upper) for stroke in figure.strokes),
        *(_text(label, left, upper) for label in figure.labels),
        "</svg>",
    ]
    return "\n".join(lines)


def standalone(figure: Figure, title: str) -> str:
    """A file of its own, without names, for an icon."""
    bare = svg(Figure(figure.strokes), title, LIGHT)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{bare}\n'


def _room(figure: Figure) -> tuple[float, float, float, float]:
    """The bounds of strokes and names, with a margin."""
    left, lower, right, upper = bounds(figure)
    for label in figure.labels:
        x, y = label.point
        left, lower = min(left, x), min(lower, y - 0.3 * SIZE)
        right, upper = max(right, x + _LETTER * SIZE * len(label.text)), max(upper, y + SIZE)
    wide = max(_MARGIN, (_LEAST[0] - right + left) / 2)
    high = max(_MARGIN, (_LEAST[1] - upper + lower) / 2)
    return left - wide, lower - high, right + wide, upper + high


def _text(label: Label, left: float, upper: float) -> str:
    """A name, on a halo that keeps it apart from the lines behind it."""
    place = f'x="{label.point[0] - left:.2f}" y="{upper - label.point[1]:.2f}"'
    text = escape(label.text)
    halo = f'<text class="halo" aria-hidden="true" {place}>{text}</text>'
    return f'{halo}<text class="{label.style}" {place}>{text}</text>'


def _path(stroke: Stroke, left: float, upper: float) -> str:
    def place(point: Point) -> str:
        return f"{point[0] - left:.2f} {upper - point[1]:.2f}"

    kind = f"{stroke.style} area" if stroke.closed else stroke.style
    corners = " L".join(place(point) for point in stroke.points)
    return f'<path class="{kind}" d="M{corners}{" Z" if stroke.closed else ""}"/>'
