"""What a scene is made of: simple shapes in the frames of links, free of how they are drawn.

Every primitive has a role, by which a viewer shows and hides it, and the name of a colour, or
"#rrggbb".
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


# Colours of a picture by the names that primitives use, on a light and on a dark background.


Theme = Literal["light", "dark"]
Colours = Mapping[str, str | float | list[str]]

LINK_COLOURS = ("link0", "link1", "link2", "link3", "link4", "link5")
"""Links take these one after the other."""

_LIGHT: Colours = {
    "background": "#f6f7f9",
    "text": "#1f2933",
    "grid": "#aab4c0",
    "bounce": "#c9d2de",
    "shadow": 0.2,  # part of black over the ground
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
    "shadow": 0.45,  # on a dark ground more
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
