"""A drawing as plain strokes in the plane, before it is text or pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Point = tuple[float, float]
Style = Literal["link", "axis", "joint", "closing", "ground", "force", "frame", "mass"]


@dataclass(frozen=True, slots=True)
class Stroke:
    """A line through points, closed into an area or not.

    Attributes:
        style: what it stands for.
        points: in the plane, y upwards, in the unit of the drawing.
        closed: the last point is joined to the first one and the area is filled.
    """

    style: Style
    points: tuple[Point, ...]
    closed: bool = False


@dataclass(frozen=True, slots=True)
class Label:
    """A name beside a point."""

    style: Style
    text: str
    point: Point


@dataclass(frozen=True, slots=True)
class Figure:
    """A drawing; its longer side is about 100 units.

    Attributes:
        strokes: from back to front.
        labels: names.
        caption: how one looks at it.
    """

    strokes: tuple[Stroke, ...]
    labels: tuple[Label, ...] = ()
    caption: str = ""


def bounds(figure: Figure) -> tuple[float, float, float, float]:
    """Left, lower, right and upper end of the strokes; a unit square without any."""
    points = [point for stroke in figure.strokes for point in stroke.points]
    if not points:
        return 0.0, 0.0, 1.0, 1.0
    x, y = zip(*points, strict=True)
    return min(x), min(y), max(x), max(y)
