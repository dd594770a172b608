"""The icon of an FMU: its drawing as a small PNG picture, without names."""

from __future__ import annotations

import struct
import zlib

import numpy as np

from mbs.export.fmu.figure import Figure, Stroke, bounds
from mbs.export.fmu.projection import Array

SIZE = 200
"""Width and height of the picture in pixels."""

_MARGIN = 12.0
_WIDTHS = {"link": 7.0, "joint": 2.2, "closing": 2.2, "ground": 2.0, "force": 3.0}
_COLOURS = {
    "link": (109, 136, 163),
    "joint": (31, 45, 61),
    "closing": (181, 72, 12),
    "ground": (123, 128, 136),
    "force": (44, 122, 75),
}
_BODY = (251, 251, 248)
_GRID = np.stack(np.meshgrid(np.arange(SIZE) + 0.5, np.arange(SIZE) + 0.5), axis=-1)
"""(SIZE, SIZE, 2) middle of each pixel, x to the right and y down."""


def icon(figure: Figure) -> bytes:
    """The picture, with smooth edges on a transparent ground.

    Args:
        figure: what to draw.

    Returns:
        a PNG file.
    """
    image = np.zeros((SIZE, SIZE, 4))
    left, lower, right, upper = bounds(figure)
    scale = (SIZE - 2 * _MARGIN) / max(right - left, upper - lower, 1e-9)
    middle = np.array([left + right, lower + upper]) / 2
    for stroke in figure.strokes:
        if stroke.style in _WIDTHS:
            points = (np.array(stroke.points) - middle) * (scale, -scale) + SIZE / 2
            _paint(image, stroke, points)
    return png(np.rint(255 * image).astype(np.uint8))


def png(pixels: np.ndarray[tuple[int, int, int], np.dtype[np.uint8]]) -> bytes:
    """A PNG file of (rows, columns, 4) red, green, blue and opacity.

    Source: W3C 2003, sections 5 and 7.
    """
    rows, columns = pixels.shape[:2]
    head = struct.pack(">IIBBBBB", columns, rows, 8, 6, 0, 0, 0)
    lines = b"".join(b"\0" + pixels[row].tobytes() for row in range(rows))
    parts = ((b"IHDR", head), (b"IDAT", zlib.compress(lines, 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(*part) for part in parts)


def _chunk(kind: bytes, content: bytes) -> bytes:
    check = zlib.crc32(kind + content)
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", check)


def _paint(image: Array, stroke: Stroke, points: Array) -> None:
    """Area first, then the line, over what is there; only in the window that the stroke needs."""
    width = _WIDTHS[stroke.style]
    first = np.clip(np.floor(points.min(axis=0) - width), 0, SIZE).astype(int)
    last = np.clip(np.ceil(points.max(axis=0) + width), 0, SIZE).astype(int)
    window = slice(first[1], last[1]), slice(first[0], last[0])
    part, grid = image[window], _GRID[window]
    ends = np.roll(points, -1, axis=0) if stroke.closed else points[1:]
    sides = list(zip(points, ends, strict=False))
    if stroke.closed:
        inside = _inside(grid, sides)
        colour = _COLOURS["link"] if stroke.style == "link" else _BODY
        _cover(part, inside * (0.25 if stroke.style == "link" else 1.0), colour)
    away = np.full(grid.shape[:2], np.inf)
    for a, b in sides:
        away = np.minimum(away, _distance(grid, a, b))
    _cover(part, np.clip(width / 2 + 0.5 - away, 0, 1), _COLOURS[stroke.style])


def _cover(image: Array, opacity: Array, colour: tuple[int, int, int]) -> None:
    """Lay a colour over the picture.

    Source: Porter & Duff 1984, the operator over.
    """
    total = opacity + image[..., 3] * (1 - opacity)
    share = np.where(total > 0, opacity / np.where(total > 0, total, 1), 0)[..., None]
    image[..., :3] += share * (np.array(colour) / 255 - image[..., :3])
    image[..., 3] = total


def _distance(grid: Array, a: Array, b: Array) -> Array:
    """From each pixel to the line from a to b."""
    along, length = b - a, float((b - a) @ (b - a))
    share = np.clip((grid - a) @ along / length, 0, 1) if length > 0 else np.zeros(grid.shape[:2])
    away: Array = np.linalg.norm(grid - a - share[..., None] * along, axis=-1)
    return away


def _inside(grid: Array, sides: list[tuple[Array, Array]]) -> Array:
    """Whether the middle of each pixel is in the polygon: a ray crosses its sides oddly."""
    odd = np.zeros(grid.shape[:2], dtype=bool)
    x, y = grid[..., 0], grid[..., 1]
    for (ax, ay), (bx, by) in sides:
        if ay != by:
            crossing = ax + (y - ay) / (by - ay) * (bx - ax)
            odd ^= ((ay > y) != (by > y)) & (x < crossing)
    return odd.astype(float)
