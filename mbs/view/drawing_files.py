"""Drawing as SVG text, and as a small PNG picture without names."""

from __future__ import annotations

import struct
import zlib
from html import escape

import numpy as np

from mbs.palette import Theme
from mbs.view.drawing import LETTERS, Drawing, Name, Point, Stroke
from mbs.view.posed import Array
from mbs.view.primitives import rgb

SIZE = 200
"""Width and height of the PNG picture in pixels."""

_LETTER = 0.6  # width of a letter relative to its height, for the bounds of names
_MARGIN = 4.0
_LEAST = (80.0, 30.0)  # smallest width and height of a drawing, without margins
_EDGE = 0.62  # brightness of the edge of an area relative to its colour

_SHAPES = """\
.drawing path { fill: none; stroke-linejoin: round; stroke-linecap: round; }
.drawing .axis { stroke-dasharray: 1.4 0.8 0.3 0.8; }
.drawing text { font: 3.2px sans-serif; }
.drawing .halo { stroke-width: 0.9; stroke-linejoin: round; }
"""


def svg(drawing: Drawing, title: str, *themes: Theme) -> str:
    """Return a drawing as the text of an HTML element <svg>.

    Args:
        drawing: drawing to write.
        title: title of the drawing, for screen readers.
        themes: fixed theme, such as "light". Without a theme the drawing follows the browser.
    """
    left, lower, right, upper = _room(drawing)
    width, height = right - left, upper - lower
    lines = [
        f'<svg class="drawing" xmlns="http://www.w3.org/2000/svg" role="img"'
        f' viewBox="0 0 {width:.2f} {height:.2f}">',
        f"<title>{escape(title)}</title>",
        f"<style>\n{_style(drawing, themes)}</style>",
        *(_path(stroke, left, upper) for stroke in drawing.strokes),
        *(_text(name, left, upper) for name in drawing.names),
        "</svg>",
    ]
    return "\n".join(lines)


def standalone(drawing: Drawing, title: str) -> str:
    """Return a drawing as the text of an SVG file, without names and in light colours.

    Args:
        drawing: drawing to write.
        title: title of the drawing, for screen readers.
    """
    bare = svg(Drawing(drawing.strokes), title, "light")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{bare}\n'


def _style(drawing: Drawing, themes: tuple[Theme, ...]) -> str:
    """Return the CSS rules of a drawing for given themes, or else for the theme of the browser."""
    if themes:
        return _SHAPES + "".join(_rules(drawing, theme) for theme in themes)
    dark = "@media (prefers-color-scheme: dark) {\n" + _rules(drawing, "dark") + "}\n"
    return _SHAPES + _rules(drawing, "light") + dark


def _rules(drawing: Drawing, theme: Theme) -> str:
    """Return the CSS rules for the colours of a drawing in a theme."""
    lines = {}
    for stroke in drawing.strokes:
        area = stroke.opacity > 0
        line = f"stroke: {_hex(stroke.colour, theme, _EDGE if area else 1.0)}"
        fill = f"; fill: {_hex(stroke.colour, theme, stroke.bright)}" if area else ""
        lines[f"path.{_class(stroke)}"] = line + fill
    for name in drawing.names:
        lines[f"text.{_css_name(name.colour)}"] = f"fill: {_hex(name.colour, theme)}"
    if drawing.names:
        paper = _hex("background", theme)
        lines["text.halo"] = f"fill: {paper}; stroke: {paper}"
    return "".join(f".drawing {which} {{ {what}; }}\n" for which, what in lines.items())


def _css_name(colour: str) -> str:
    """Return a colour name of the palette as a CSS class name."""
    return colour.replace(".", "-")


def _class(stroke: Stroke) -> str:
    """Return the CSS class name for colour, brightness, and kind (line or area) of a stroke."""
    if not stroke.opacity:
        return f"{_css_name(stroke.colour)}-line"
    return f"{_css_name(stroke.colour)}-{100 * stroke.bright:.0f}"


def _hex(colour: str, theme: Theme, bright: float = 1.0) -> str:
    """Return a colour of the palette as "#rrggbb", scaled by the brightness `bright`."""
    parts = np.clip(np.rint(bright * 255 * rgb(colour, theme)), 0, 255).astype(int)
    return "#" + "".join(f"{part:02x}" for part in parts)


def _room(drawing: Drawing) -> tuple[float, float, float, float]:
    """Return left, lower, right and upper bound of strokes and names, with a margin."""
    left, lower, right, upper = drawing.bounds()
    for name in drawing.names:
        x, y = name.point
        # letters extend 0.3 of their height below the baseline
        left, lower = min(left, x), min(lower, y - 0.3 * LETTERS)
        right, upper = max(right, x + _LETTER * LETTERS * len(name.text)), max(upper, y + LETTERS)
    wide = max(_MARGIN, (_LEAST[0] - right + left) / 2)
    high = max(_MARGIN, (_LEAST[1] - upper + lower) / 2)
    return left - wide, lower - high, right + wide, upper + high


def _text(name: Name, left: float, upper: float) -> str:
    """Return the SVG elements of a name and of a halo that separates it from lines below it.

    `left` and `upper` are the bounds of the drawing, which become the origin.
    """
    place = f'x="{name.point[0] - left:.2f}" y="{upper - name.point[1]:.2f}"'
    text = escape(name.text)
    halo = f'<text class="halo" aria-hidden="true" {place}>{text}</text>'
    return f'{halo}<text class="{_css_name(name.colour)}" {place}>{text}</text>'


def _path(stroke: Stroke, left: float, upper: float) -> str:
    """Return the SVG element of a stroke; `left` and `upper` are the origin of the picture."""

    def place(point: Point) -> str:
        return f"{point[0] - left:.2f} {upper - point[1]:.2f}"

    corners = " L".join(place(point) for point in stroke.points)
    clear = f' fill-opacity="{stroke.opacity:g}"' if 0 < stroke.opacity < 1 else ""
    return (
        f'<path class="{stroke.role} {_class(stroke)}" stroke-width="{stroke.width:.3g}"{clear}'
        f' d="M{corners}{" Z" if stroke.closed else ""}"/>'
    )


# PNG picture: antialiased areas and lines, drawn over each other.

_SPACE = 12.0  # margin around the drawing [pixels]
_THIN = 1.5  # smallest line width [pixels]
_LEFT_OUT = ("axis", "frame", "mass")
_GRID = np.stack(np.meshgrid(np.arange(SIZE) + 0.5, np.arange(SIZE) + 0.5), axis=-1)
"""Middle of each pixel (SIZE, SIZE, 2), x to the right and y down."""


def icon(drawing: Drawing) -> bytes:
    """Return a drawing as a PNG file of 200 x 200 pixels with transparent background.

    Frames, axes, centres of mass and names are left out.
    """
    image = np.zeros((SIZE, SIZE, 4))
    shown = Drawing(tuple(s for s in drawing.strokes if s.role not in _LEFT_OUT))
    left, lower, right, upper = shown.bounds()
    # 1e-9: arbitrary scale of a drawing that is a single point
    scale = (SIZE - 2 * _SPACE) / max(right - left, upper - lower, 1e-9)
    middle = np.array([left + right, lower + upper]) / 2
    for stroke in shown.strokes:
        points = (np.array(stroke.points) - middle) * (scale, -scale) + SIZE / 2
        _paint(image, stroke, points, max(scale * stroke.width, _THIN))
    return png(np.rint(255 * image).astype(np.uint8))


def png(pixels: np.ndarray[tuple[int, int, int], np.dtype[np.uint8]]) -> bytes:
    """Encode pixels as a PNG file.

    Source: W3C 2003, sections 5 and 7.

    Args:
        pixels: red, green, blue and opacity (rows, columns, 4), from 0 to 255.
    """
    rows, columns = pixels.shape[:2]
    head = struct.pack(">IIBBBBB", columns, rows, 8, 6, 0, 0, 0)
    lines = b"".join(b"\0" + pixels[row].tobytes() for row in range(rows))
    parts = ((b"IHDR", head), (b"IDAT", zlib.compress(lines, 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(*part) for part in parts)


def _chunk(kind: bytes, content: bytes) -> bytes:
    """Return a chunk of a PNG file: length, kind, content and checksum."""
    check = zlib.crc32(kind + content)
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", check)


def _paint(image: Array, stroke: Stroke, points: Array, width: float) -> None:
    """Draw area and line of a stroke over an image (SIZE, SIZE, 4), which is changed.

    `points` (k, 2) and `width` are in pixels.
    """
    first = np.clip(np.floor(points.min(axis=0) - width), 0, SIZE).astype(int)
    last = np.clip(np.ceil(points.max(axis=0) + width), 0, SIZE).astype(int)
    window = slice(first[1], last[1]), slice(first[0], last[0])
    part, grid = image[window], _GRID[window]
    ends = np.roll(points, -1, axis=0) if stroke.closed else points[1:]
    sides = list(zip(points, ends, strict=False))
    colour, edge = rgb(stroke.colour, "light"), 1.0
    if stroke.opacity > 0:
        _cover(part, _inside(grid, sides) * stroke.opacity, np.clip(stroke.bright * colour, 0, 1))
        edge = _EDGE
    away = np.full(grid.shape[:2], np.inf)
    for a, b in sides:
        away = np.minimum(away, _distance(grid, a, b))
    _cover(part, np.clip(width / 2 + 0.5 - away, 0, 1), edge * colour)


def _cover(image: Array, opacity: Array, colour: Array) -> None:
    """Blend a colour (3,) with an opacity per pixel over an image, which is changed.

    Source: Porter & Duff 1984, operator `over`.
    """
    total = opacity + image[..., 3] * (1 - opacity)
    share = np.where(total > 0, opacity / np.where(total > 0, total, 1), 0)[..., None]
    image[..., :3] += share * (colour - image[..., :3])
    image[..., 3] = total


def _distance(grid: Array, a: Array, b: Array) -> Array:
    """Return the distance of each pixel from the line segment a to b [pixels].

    `grid` are the pixel positions (..., 2).
    """
    along, length, start = b - a, float((b - a) @ (b - a)), grid - a
    if length == 0:
        share = np.zeros(grid.shape[:2])
    else:
        share = np.minimum(np.maximum(start @ along / length, 0), 1)
    x, y = start[..., 0] - share * along[0], start[..., 1] - share * along[1]
    away: Array = np.sqrt(x * x + y * y)
    return away


def _inside(grid: Array, sides: list[tuple[Array, Array]]) -> Array:
    """Return 1 for pixels inside a polygon, else 0, by counting crossings of its sides.

    `sides` are pairs of end points.
    """
    odd = np.zeros(grid.shape[:2], dtype=bool)
    x, y = grid[..., 0], grid[..., 1]
    for (ax, ay), (bx, by) in sides:
        if ay != by:
            crossing = ax + (y - ay) / (by - ay) * (bx - ax)
            odd ^= ((ay > y) != (by > y)) & (x < crossing)
    return odd.astype(float)
