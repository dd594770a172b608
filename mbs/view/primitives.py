"""What a scene is made of: simple shapes in the frames of links, free of how they are drawn.

Every primitive has a role, by which a viewer shows and hides it, and the name of a colour, or
"#rrggbb".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs.palette import LINK_COLOURS, PALETTE, Theme

Vector = tuple[float, float, float]
Rows = tuple[float, ...]
"""A pose: the rows of R|p, 12 numbers."""


@dataclass(frozen=True, slots=True)
class BarShape:
    """A round bar with rounded ends from a to b [m], in the frame of the link."""

    role: str
    link: int
    colour: str
    a: Vector
    b: Vector
    radius: float


@dataclass(frozen=True, slots=True)
class CylinderShape:
    """A cylinder from a to b [m], with a bore where that is above zero [m]."""

    role: str
    link: int
    colour: str
    a: Vector
    b: Vector
    radius: float
    bore: float = 0.0


@dataclass(frozen=True, slots=True)
class BallShape:
    """A sphere at a point [m]."""

    role: str
    link: int
    colour: str
    at: Vector
    radius: float


@dataclass(frozen=True, slots=True)
class BoxShape:
    """A cuboid with these sides [m] about the origin of a pose."""

    role: str
    link: int
    colour: str
    pose: Rows
    size: Vector


@dataclass(frozen=True, slots=True)
class RingShape:
    """A ring about an axis through a point: radius of its middle line and of the tube [m]."""

    role: str
    link: int
    colour: str
    at: Vector
    axis: Vector
    radius: float
    tube: float


@dataclass(frozen=True, slots=True)
class PlateShape:
    """A thin polygon with these corners [m]."""

    role: str
    link: int
    colour: str
    points: tuple[Vector, ...]
    opacity: float


@dataclass(frozen=True, slots=True)
class MeshShape:
    """A surface of triangles: its points [m] in the frame of a pose, and three numbers each.

    Attributes:
        points: x, y and z of one point after another.
        triangles: numbers of points, three for each triangle.
    """

    role: str
    link: int
    colour: str
    pose: Rows
    points: tuple[float, ...]
    triangles: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class FrameShape:
    """Three arrows along the axes of a frame: pose, and their length [m]."""

    role: str
    link: int
    pose: Rows
    length: float
    colour: str = "axes"


@dataclass(frozen=True, slots=True)
class AxisShape:
    """A dashed line from a to b [m]."""

    role: str
    link: int
    a: Vector
    b: Vector
    colour: str = "axis"


@dataclass(frozen=True, slots=True)
class LabelShape:
    """A text beside a point [m], above as many others that are there as `row` says."""

    role: str
    link: int
    at: Vector
    text: str
    row: int = 0
    colour: str = "text"


@dataclass(frozen=True, slots=True)
class SpanShape:
    """A round bar between points on two links, however far apart they are.

    `ends` are in the frames of the two links [m].
    """

    role: str
    links: tuple[int, int]
    colour: str
    ends: tuple[Vector, Vector]
    radius: float


@dataclass(frozen=True, slots=True)
class SpringShape:
    """A coil between points on two links; `length` is the one at which its wire is round [m]."""

    role: str
    links: tuple[int, int]
    colour: str
    ends: tuple[Vector, Vector]
    radius: float
    length: float


Primitive = (
    BarShape
    | CylinderShape
    | BallShape
    | BoxShape
    | RingShape
    | PlateShape
    | MeshShape
    | FrameShape
    | AxisShape
    | LabelShape
    | SpanShape
    | SpringShape
)


def link_colour(number: int) -> str:
    """The name of the colour of a link, 0 for the base."""
    return "base" if number == 0 else LINK_COLOURS[(number - 1) % len(LINK_COLOURS)]


def rgb(name: str, theme: Theme) -> NDArray[np.float64]:
    """Red, green and blue from 0 to 1 of a colour.

    Args:
        name: in the palette; "axes.0" is the first colour of the axes, "#rrggbb" one of its own.
        theme: light or dark.
    """
    text = name
    if not name.startswith("#"):
        first, _, number = name.partition(".")
        value = PALETTE[theme][first]
        text = value[int(number)] if isinstance(value, list) else str(value)
    return np.array([int(text[k : k + 2], 16) / 255 for k in (1, 3, 5)])
