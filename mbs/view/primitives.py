"""Primitives of a scene: simple shapes in the frames of links, independent of the viewer.

Every primitive has a role, by which a viewer shows or hides it, and a colour: a name in the palette
or "#rrggbb". `link` is the number of its link, 0 for the base.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Vector = tuple[float, float, float]
Rows = tuple[float, ...]
"""Pose as 12 numbers: the rows of [R p]."""


@dataclass(frozen=True, slots=True)
class BarShape:
    """Round bar with hemispherical ends from a to b [m] in the link frame. radius: in m."""

    role: str
    link: int
    colour: str
    a: Vector
    b: Vector
    radius: float


@dataclass(frozen=True, slots=True)
class CylinderShape:
    """Cylinder from a to b [m] in the link frame. bore: radius of its bore [m], 0 if solid."""

    role: str
    link: int
    colour: str
    a: Vector
    b: Vector
    radius: float
    bore: float = 0.0


@dataclass(frozen=True, slots=True)
class BallShape:
    """Sphere about a point [m] in the link frame."""

    role: str
    link: int
    colour: str
    at: Vector
    radius: float


@dataclass(frozen=True, slots=True)
class BoxShape:
    """Cuboid with side lengths `size` [m], centred at a pose in the link frame."""

    role: str
    link: int
    colour: str
    pose: Rows
    size: Vector


@dataclass(frozen=True, slots=True)
class RingShape:
    """Ring (torus) about an axis through a point in the link frame.

    radius: radius of its centre line [m]. tube: radius of the tube [m].
    """

    role: str
    link: int
    colour: str
    at: Vector
    axis: Vector
    radius: float
    tube: float


@dataclass(frozen=True, slots=True)
class PlateShape:
    """Thin convex polygon with corners `points` [m] in the link frame."""

    role: str
    link: int
    colour: str
    points: tuple[Vector, ...]
    opacity: float


@dataclass(frozen=True, slots=True)
class MeshShape:
    """Triangle mesh at a pose in the link frame.

    Attributes:
        points: coordinates x, y, z [m] of all points, in sequence.
        triangles: indices of points, three for each triangle.
    """

    role: str
    link: int
    colour: str
    pose: Rows
    points: tuple[float, ...]
    triangles: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class FrameShape:
    """Three arrows of a length [m] along the axes of a pose in the link frame."""

    role: str
    link: int
    pose: Rows
    length: float
    colour: str = "axes"


@dataclass(frozen=True, slots=True)
class AxisShape:
    """Dashed line from a to b [m] in the link frame."""

    role: str
    link: int
    a: Vector
    b: Vector
    colour: str = "axis"


@dataclass(frozen=True, slots=True)
class LabelShape:
    """Text next to a point [m] in the link frame. row: number of texts below it at this point."""

    role: str
    link: int
    at: Vector
    text: str
    row: int = 0
    colour: str = "text"


@dataclass(frozen=True, slots=True)
class SpanShape:
    """Round bar of variable length between points on two links.

    ends: points in the frames of the two links [m].
    """

    role: str
    links: tuple[int, int]
    colour: str
    ends: tuple[Vector, Vector]
    radius: float


@dataclass(frozen=True, slots=True)
class SpringShape:
    """Coil spring of variable length between points on two links.

    ends: points in the frames of the two links [m]. length: length at which its wire is round [m].
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


# Colours by name, for a light and a dark background.


Theme = Literal["light", "dark"]
Colours = Mapping[str, str | float | list[str]]

LINK_COLOURS = ("link0", "link1", "link2", "link3", "link4", "link5")
"""Colours of consecutive links, repeated cyclically."""

_LIGHT: Colours = {
    "background": "#f6f7f9",
    "text": "#1f2933",
    "grid": "#aab4c0",
    "bounce": "#c9d2de",
    "shadow": 0.2,  # opacity of black shadows on the ground
    "base": "#454f5b",
    "link0": "#5288c1",
    "link1": "#56a38f",
    "link2": "#d0a24c",
    "link3": "#8878bd",
    "link4": "#86a857",
    "link5": "#bf7f6a",
    "joint": "#8a94a1",
    "active": "#e8871e",
    "loop": "#d6336c",
    "force": "#2f8f5b",
    "axis": "#7a8699",
    "axes": ["#e03131", "#2f9e44", "#1c6dd0"],
}
_DARK: Colours = {
    "background": "#15181d",
    "text": "#e6eaf0",
    "grid": "#49525f",
    "bounce": "#3b4450",
    "shadow": 0.45,  # opacity of black shadows, higher on a dark ground
    "base": "#6d7887",
    "link0": "#6ba3dc",
    "link1": "#69bda6",
    "link2": "#dfb663",
    "link3": "#a294d8",
    "link4": "#9dc16b",
    "link5": "#d6957f",
    "joint": "#aab3bf",
    "active": "#f59a36",
    "loop": "#f0598b",
    "force": "#4cc38a",
    "axis": "#8793a5",
    "axes": ["#ff6b6b", "#51cf66", "#4dabf7"],
}
PALETTE: Mapping[Theme, Colours] = MappingProxyType({"light": _LIGHT, "dark": _DARK})


def link_colour(number: int) -> str:
    """Return the colour name of a link. number: 0 for the base."""
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
