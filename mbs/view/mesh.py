"""Conversion of primitives to small flat faces, for pictures without a browser."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mbs.view.posed import Array
from mbs.view.primitives import (
    AxisShape,
    BallShape,
    BarShape,
    BoxShape,
    CylinderShape,
    FrameShape,
    MeshShape,
    PlateShape,
    Primitive,
    RingShape,
    SpanShape,
    SpringShape,
    rotation_onto,
)

_SIDES = 14
_PIECES = 8
"""Number of pieces of a long bar. Short faces are needed, because faces are sorted by middle."""

_TURNS = 8
BOX_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
BOX_FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


@dataclass(frozen=True, slots=True, eq=False)
class Faces:
    """Flat faces of the same colour in one frame.

    Attributes:
        corners: corners (n, 4, 3) of n faces [m], counterclockwise as seen from outside. A triangle
            repeats a corner, and a line has each of its two ends twice.
        colour: name in the palette, or "axes.0" for the first colour of the axes.
        kind: "closed" (visible from outside only), "open" (visible from both sides) or "line".
        opacity: opacity, 1 for opaque faces.
    """

    corners: Array
    colour: str
    kind: str = "closed"
    opacity: float = 1.0


def faces_of(item: Primitive, size: float) -> Iterator[Faces]:
    """Yield the faces of a primitive in the frame of its link.

    Args:
        item: primitive on a single link. A label has no faces.
        size: size of the mechanism [m], for the dashes of axes.
    """
    if isinstance(item, (BarShape, CylinderShape)):
        yield Faces(_bar_faces(item), item.colour)
    elif isinstance(item, BallShape):
        angle = np.linspace(-np.pi / 2, np.pi / 2, 9)
        profile = item.radius * np.column_stack([np.cos(angle), np.sin(angle)])
        yield Faces(revolve(profile) + np.array(item.at), item.colour)
    elif isinstance(item, RingShape):
        angle = np.linspace(0, 2 * np.pi, 9)
        profile = item.tube * np.column_stack([np.cos(angle), np.sin(angle)]) + [item.radius, 0]
        R = rotation_onto(np.array(item.axis))
        yield Faces(revolve(profile, 48) @ R.T + np.array(item.at), item.colour)
    elif isinstance(item, BoxShape):
        yield Faces(_transformed(_cuboid(np.array(item.size)), item.pose), item.colour)
    elif isinstance(item, MeshShape):
        corners = np.reshape(item.points, (-1, 3))[np.reshape(item.triangles, (-1, 3))]
        # visible from both sides, because the orientation in mesh files is not reliable
        yield Faces(_transformed(corners[:, [0, 1, 2, 2]], item.pose), item.colour, "open")
    elif isinstance(item, PlateShape):
        yield Faces(_fan(np.array(item.points)), item.colour, "open", item.opacity)
    elif isinstance(item, FrameShape):
        for k in range(3):
            arrow = _arrow(item.length) @ rotation_onto(np.eye(3)[k]).T
            yield Faces(_transformed(arrow, item.pose), f"axes.{k}")
    elif isinstance(item, AxisShape):
        yield Faces(_dashes(np.array(item.a), np.array(item.b), size), item.colour, "line")


def stretch(item: SpanShape | SpringShape, a: Array, b: Array) -> Faces:
    """Return the faces of a bar or spring between two points.

    Args:
        item: bar or spring of variable length.
        a: first end point (3,) in the base frame [m].
        b: second end point (3,) in the base frame [m].
    """
    if isinstance(item, SpanShape):
        bar = _bar_faces(CylinderShape(item.role, 0, item.colour, tuple(a), tuple(b), item.radius))
        return Faces(bar, item.colour)
    t = np.linspace(0, 1, 24 * _TURNS + 1)
    grown = item.radius * np.minimum(1, 12 * np.minimum(t, 1 - t))
    angle = 2 * np.pi * _TURNS * t
    length = float(np.linalg.norm(b - a))
    wire = np.column_stack([grown * np.cos(angle), grown * np.sin(angle), length * t])
    path = wire @ rotation_onto(b - a).T + a
    return Faces(np.stack([path[:-1], path[:-1], path[1:], path[1:]], axis=1), item.colour, "line")


def revolve(profile: Array, sides: int = _SIDES) -> Array:
    """Return the faces of a surface of revolution about z.

    Args:
        profile: radius and height (k, 2) of points along the profile.
        sides: number of faces around the axis.

    Returns:
        Corners (n, 4, 3) of the faces.
    """
    angle = np.linspace(0, 2 * np.pi, sides + 1)
    round_ = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rings = np.concatenate(
        [
            profile[:, None, :1] * round_[None],
            np.repeat(profile[:, None, 1:], sides + 1, axis=1),
        ],
        axis=2,
    )
    below, above = rings[:-1], rings[1:]
    faces = np.stack([below[:, :-1], below[:, 1:], above[:, 1:], above[:, :-1]], axis=2)
    return faces.reshape(-1, 4, 3)


def _bar_faces(item: BarShape | CylinderShape) -> Array:
    """Return the faces (n, 4, 3) of a round bar or of a cylinder in the link frame [m]."""
    a, b = np.array(item.a), np.array(item.b)
    length, r = float(np.linalg.norm(b - a)), item.radius
    along = np.column_stack([np.full(_PIECES + 1, r), np.linspace(0, length, _PIECES + 1)])
    if isinstance(item, BarShape):
        angle = np.linspace(0, np.pi / 2, 4)
        foot = r * np.column_stack([np.sin(angle), -np.cos(angle)])
        head = r * np.column_stack([np.cos(angle), np.sin(angle)]) + [0, length]
        profile = np.vstack([foot, along[1:-1], head])
    else:
        profile = np.vstack([[item.bore, 0], along, [item.bore, length]])
        if item.bore > 0:
            profile = np.vstack([profile, [item.bore, 0]])
    faces: Array = revolve(profile) @ rotation_onto(b - a).T + a
    return faces


def _cuboid(size: Array) -> Array:
    """Return the faces (n, 4, 3) of a cuboid about the origin, divided along its longest side.

    `size` are its side lengths (3,).
    """
    longest = int(np.argmax(size))
    faces = []
    for corners in BOX_CORNERS[np.array(BOX_FACES)]:
        first, last = corners[:, longest].min(), corners[:, longest].max()
        cuts = np.linspace(first, last, _PIECES + 1) if last > first else np.array([first, last])
        for low, high in itertools.pairwise(cuts):
            piece = corners.copy()
            piece[:, longest] = np.where(corners[:, longest] == first, low, high)
            faces.append(piece * size)
    return np.array(faces)


def _arrow(length: float) -> Array:
    """Return the faces (n, 4, 3) of an arrow of a given length from the origin along z."""
    # relative to the length: shaft radius 0.03, head length 0.2
    profile = [[0, 0], [0.03, 0], [0.03, 0.4], [0.03, 0.8], [0.08, 0.8], [0, 1]]
    return revolve(length * np.array(profile), 8)


def _transformed(faces: Array, rows: tuple[float, ...]) -> Array:
    """Transform faces (n, 4, 3) by a pose, given as the 12 numbers of the rows of [R p]."""
    pose = np.array(rows).reshape(3, 4)
    return np.array(faces @ pose[:, :3].T + pose[:, 3])


def _fan(points: Array) -> Array:
    """Return the triangles (n, 4, 3) of a convex polygon with corners (k, 3)."""
    return np.array([[points[0], b, c, c] for b, c in itertools.pairwise(points[1:])])


def _dashes(a: Array, b: Array, size: float) -> Array:
    """Return the dashes (n, 4, 3) of a line from a to b; `size` is that of the mechanism [m]."""
    # a dash and a gap together are 0.032 of the size of the mechanism on all axes
    count = max(1, round(float(np.linalg.norm(b - a)) / (0.032 * size)))
    starts = np.arange(count) / count
    first = a + starts[:, None] * (b - a)
    last = a + (starts + 0.62 / count)[:, None] * (b - a)
    return np.stack([first, first, last, last], axis=1)
