"""The signs of joints, ground, springs and frames, as strokes."""

from __future__ import annotations

import math

import numpy as np

from mbs.export.fmu.figure import Point, Stroke, Style
from mbs.export.fmu.projection import Array, Projection

_RADIUS = 1.7
_LENGTH = 2.6
_AXIS = 6.0
_ROUND = np.linspace(0.0, 2.0 * math.pi, 40, endpoint=False)


def _path(points: Array) -> tuple[Point, ...]:
    return tuple((float(x), float(y)) for x, y in points)


def line(style: Style, *points: Array) -> Stroke:
    """A line through points, each (2,)."""
    return Stroke(style, _path(np.array(points)))


def disc(style: Style, at: Array, radius: float) -> Stroke:
    """A filled circle about a point (2,)."""
    ring = np.column_stack((np.cos(_ROUND), np.sin(_ROUND)))
    return Stroke(style, _path(at + radius * ring), closed=True)


def cylinder(style: Style, view: Projection, at: Array, axis: Array) -> list[Stroke]:
    """A joint that turns: a cylinder along its axis (3,), and a piece of the axis."""
    one, other = _across(axis)
    ring = np.outer(np.cos(_ROUND), one) + np.outer(np.sin(_ROUND), other)
    ends = [_RADIUS * ring + side * _LENGTH * axis for side in (-1, 1)]
    return _solid(style, view, at, axis, np.vstack(ends))


def slide(style: Style, view: Projection, at: Array, axis: Array) -> list[Stroke]:
    """A joint that slides: a box along its axis (3,), and a piece of the axis."""
    one, other = _across(axis)
    corners = [
        _RADIUS * (a * one + b * other) + c * 1.3 * _LENGTH * axis
        for a in (-1, 1)
        for b in (-1, 1)
        for c in (-1, 1)
    ]
    return _solid(style, view, at, axis, np.array(corners))


def ground(at: Array) -> list[Stroke]:
    """The base under a point (2,): a line with hatches."""
    x, y = at[0], at[1] - 2.6
    strokes = [line("ground", np.array([x - 4, y]), np.array([x + 4, y]))]
    for start in (-3.0, -1.0, 1.0, 3.0):
        head = np.array([x + start, y])
        strokes.append(line("ground", head, head - np.array([1.4, 1.8])))
    return strokes


def zigzag(start: Array, end: Array) -> Stroke:
    """A spring between two points (2,)."""
    along = end - start
    length = float(np.linalg.norm(along))
    if length < 1e-9:
        return line("force", start, end)
    across = np.array([-along[1], along[0]]) / length
    swing = [0.0, 0.0, *(2.0 * (-1.0) ** k for k in range(8)), 0.0, 0.0]
    places = [0.0, 0.15, *np.linspace(0.2, 0.8, 8), 0.85, 1.0]
    return line(
        "force", *(start + s * along + w * across for s, w in zip(places, swing, strict=True))
    )


def tripod(view: Projection, at: Array, axes: Array, length: float) -> list[Stroke]:
    """The three axes, rows of (3, 3), of a frame at a point (2,)."""
    ends = at + length * view.of(axes)
    return [line("frame", at, end) for end in ends if np.linalg.norm(end - at) > 0.05 * length]


def _across(axis: Array) -> tuple[Array, Array]:
    """Two unit vectors that are orthogonal to an axis and to each other."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    one = np.cross(axis, helper)
    one /= np.linalg.norm(one)
    return one, np.cross(axis, one)


def _solid(style: Style, view: Projection, at: Array, axis: Array, corners: Array) -> list[Stroke]:
    flat = view.of(axis)
    body = Stroke(style, _path(at + _hull(view.of(corners))), closed=True)
    if np.linalg.norm(flat) < 0.1:
        return [body]
    return [line("axis", at - _AXIS * flat, at + _AXIS * flat), body]


def _hull(points: Array) -> Array:
    """The convex hull, counterclockwise.

    Source: Andrew 1979, the monotone chain.
    """
    rows = sorted({(round(float(x), 9), round(float(y), 9)) for x, y in points})
    lower, upper = _chain(rows), _chain(rows[::-1])
    return np.array(lower[:-1] + upper[:-1] or rows)


def _chain(rows: list[Point]) -> list[Point]:
    chain: list[Point] = []
    for row in rows:
        while len(chain) > 1 and _turn(chain[-2], chain[-1], row) <= 0:
            chain.pop()
        chain.append(row)
    return chain


def _turn(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
