"""Primitives of a scene: simple shapes in the frames of links, independent of the viewer.

Every primitive has a role, by which a viewer shows or hides it, and a colour: a name in the palette
or "#rrggbb". `link` is the number of its link, 0 for the base.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs.palette import LINK_COLOURS, PALETTE, Theme

Vector = tuple[float, float, float]
Rows = tuple[float, ...]
"""Pose as 12 numbers: the rows of [R p]."""


@dataclass(frozen=True, slots=True)
class LinkShape:
    """Primitive on one link.

    Attributes:
        role: kind of element, by which viewers show or hide it.
        link: number of its link, 0 for the base.
        colour: name in the palette, or "#rrggbb".
    """

    role: str
    link: int
    colour: str


@dataclass(frozen=True, slots=True)
class BarShape(LinkShape):
    """Round bar with hemispherical ends from a to b [m] in the link frame.

    Attributes:
        radius: radius of the bar [m].
    """

    a: Vector
    b: Vector
    radius: float


@dataclass(frozen=True, slots=True)
class CylinderShape(LinkShape):
    """Cylinder from a to b [m] in the link frame.

    Attributes:
        radius: outer radius [m].
        bore: radius of its bore [m], 0 if solid.
    """

    a: Vector
    b: Vector
    radius: float
    bore: float = 0.0


@dataclass(frozen=True, slots=True)
class BallShape(LinkShape):
    """Sphere about a point in the link frame.

    Attributes:
        at: centre [m].
        radius: radius [m].
    """

    at: Vector
    radius: float


@dataclass(frozen=True, slots=True)
class BoxShape(LinkShape):
    """Cuboid at a pose in the link frame.

    Attributes:
        pose: pose of its centre, the 12 numbers of the rows of [R p].
        size: side lengths along the axes of the pose [m].
    """

    pose: Rows
    size: Vector


@dataclass(frozen=True, slots=True)
class RingShape(LinkShape):
    """Ring (torus) about a direction `axis` through the point `at` [m] in the link frame.

    Attributes:
        radius: radius of its centre line [m].
        tube: radius of the tube [m].
    """

    at: Vector
    axis: Vector
    radius: float
    tube: float


@dataclass(frozen=True, slots=True)
class PlateShape(LinkShape):
    """Thin convex polygon in the link frame.

    Attributes:
        points: corners [m].
        opacity: opacity from 0 to 1.
    """

    points: tuple[Vector, ...]
    opacity: float


@dataclass(frozen=True, slots=True)
class MeshShape(LinkShape):
    """Triangle mesh at a pose in the link frame.

    Attributes:
        points: coordinates x, y, z [m] of all points, in sequence.
        triangles: indices of points, three for each triangle.
    """

    pose: Rows
    points: tuple[float, ...]
    triangles: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class FrameShape:
    """Three arrows along the axes of a frame in the link frame.

    Attributes:
        pose: pose of the frame, the 12 numbers of the rows of [R p].
        length: length of the arrows [m].
    """

    role: str
    link: int
    pose: Rows
    length: float
    colour: str = "axes"


@dataclass(frozen=True, slots=True)
class AxisShape:
    """Dashed line of an axis in the link frame.

    Attributes:
        a, b: ends of the line [m].
    """

    role: str
    link: int
    a: Vector
    b: Vector
    colour: str = "axis"


@dataclass(frozen=True, slots=True)
class LabelShape:
    """Text next to the point `at` [m] in the link frame.

    Attributes:
        row: number of other texts below it at this point.
    """

    role: str
    link: int
    at: Vector
    text: str
    row: int = 0
    colour: str = "text"


@dataclass(frozen=True, slots=True)
class SpanShape:
    """Round bar of variable length between points on two links.

    Attributes:
        ends: end points in the frames of the two links [m].
        radius: radius of the bar [m].
    """

    role: str
    links: tuple[int, int]
    colour: str
    ends: tuple[Vector, Vector]
    radius: float


@dataclass(frozen=True, slots=True)
class SpringShape:
    """Coil spring of variable length between points on two links.

    Attributes:
        ends: end points in the frames of the two links [m].
        radius: radius of the coil [m].
        length: length of the spring at which its wire is drawn with a round cross-section [m].
    """

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
    """Return the colour name of a link in the palette.

    Args:
        number: number of the link, 0 for the base.
    """
    return "base" if number == 0 else LINK_COLOURS[(number - 1) % len(LINK_COLOURS)]


def rgb(name: str, theme: Theme) -> NDArray[np.float64]:
    """Return red, green and blue (3,) of a colour, from 0 to 1.

    Args:
        name: name in the palette, "axes.0" for the first colour of the axes, or "#rrggbb".
        theme: light or dark.
    """
    text = name
    if not name.startswith("#"):
        first, _, number = name.partition(".")
        value = PALETTE[theme][first]
        text = value[int(number)] if isinstance(value, list) else str(value)
    return np.array([int(text[k : k + 2], 16) / 255 for k in (1, 3, 5)])


def rotation_onto(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a rotation matrix whose z axis has the given direction, or the identity for zero."""
    length = float(np.linalg.norm(direction))
    if length == 0:
        return np.eye(3)
    z = direction / length
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])
