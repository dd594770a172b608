"""Plane drawing of a scene with areas and lines, for documents and icons.

It is the orthographic projection of the shapes of the scene. Joints are drawn over the links that
they join, so that each joint is visible.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mbs.assembly import System
from mbs.view._scene import scene
from mbs.view.mesh import BOX_CORNERS, BOX_FACES
from mbs.view.posed import Array, PosedLinks, plane_normal, pose_links
from mbs.view.primitives import (
    AxisShape,
    BallShape,
    BarShape,
    BoxShape,
    CylinderShape,
    FrameShape,
    PlateShape,
    Primitive,
    RingShape,
    SpanShape,
    SpringShape,
    Vector,
    rotation_onto,
)

Point = tuple[float, float]

LETTERS = 3.2
"""Height of the letters, in units of the drawing."""

_SIZE = 100.0
"""Larger side of a drawing in drawing units, the unit of all lengths and line widths below."""
_PARALLEL = 1e-6  # largest sine of the angle of parallel axes: files contain six digits
_ROUND = np.linspace(0.0, 2.0 * math.pi, 32, endpoint=False)
_CIRCLE = np.column_stack([np.cos(_ROUND), np.sin(_ROUND), np.zeros(32)])
_LIGHT = np.array([0.08, 0.2, 0.1])
"""Increase of brightness of box faces by the components of their normal: right, up, to the eye."""

_ORDER = ("base", "link", "force", "axis", "joint", "loop", "frame")
"""Roles from back to front. Joints and loops are one group."""


@dataclass(frozen=True, slots=True)
class Stroke:
    """Polyline or polygon.

    Attributes:
        role: role of the primitive that it draws, or "mass" for a centre of mass.
        colour: name in the palette, or "axes.0" for the first colour of the axes.
        points: points in the plane, y upwards, in drawing units.
        closed: whether the last point is joined to the first.
        opacity: opacity of the area, 0 for no fill.
        width: line width in drawing units.
        bright: brightness of the area relative to the colour in the palette.
    """

    role: str
    colour: str
    points: tuple[Point, ...]
    closed: bool = False
    opacity: float = 0.0
    width: float = 0.5
    bright: float = 1.0


@dataclass(frozen=True, slots=True)
class Name:
    """Text at a point of a drawing.

    Attributes:
        colour: name in the palette.
        text: text.
        point: point to which the text belongs; in a finished drawing the lower left corner of the
            text. In drawing units, y upwards.
    """

    colour: str
    text: str
    point: Point


@dataclass(frozen=True, slots=True)
class Drawing:
    """Plane drawing of a mechanism. Its longer side is about 100 units.

    Attributes:
        strokes: lines and areas from back to front.
        names: names of joints, links, force elements and frames.
        caption: description of the view.
    """

    strokes: tuple[Stroke, ...]
    names: tuple[Name, ...] = ()
    caption: str = ""

    def bounds(self) -> tuple[float, float, float, float]:
        """Return left, lower, right and upper bound of the strokes in drawing units.

        A drawing without strokes has the bounds of a unit square.
        """
        points = [point for stroke in self.strokes for point in stroke.points]
        if not points:
            return 0.0, 0.0, 1.0, 1.0
        x, y = zip(*points, strict=True)
        return min(x), min(y), max(x), max(y)


@dataclass(frozen=True, slots=True, eq=False)
class _OrthographicView:
    """Orthographic view of posed links.

    Attributes:
        axes: unit vectors (3, 3) by rows: to the right, upwards, towards the eye.
        caption: description of the view.
        poses: poses (links + 1, 3, 4) of the base and every link.
        scale: drawing units per metre.
    """

    axes: Array
    caption: str
    poses: Array
    scale: float = 1.0

    def seen(self, points: Array) -> Array:
        """Project points of the base frame to the drawing.

        `points` are (..., 3) [m]; the result (..., 3) is (right, up, towards the viewer) in drawing
        units.
        """
        return np.array(self.scale * (points @ self.axes.T))

    def project(self, link: int, points: Sequence[Vector] | Vector | Array) -> Array:
        """Project points of a link frame to the drawing.

        `points` are (..., 3) [m]; the result (..., 3) is (right, up, towards the viewer) in drawing
        units.
        """
        R, p = self.poses[link, :, :3], self.poses[link, :, 3]
        return self.seen(np.array(points) @ R.T + p)


def drawing(
    system: System,
    q: Mapping[str, float] | Sequence[float] | None = None,
    parameters: Mapping[str, float] | None = None,
) -> Drawing:
    """Draw a mechanism in the plane of its motion, or at an angle from above if it is spatial.

    Args:
        system: mechanism, open or closed. Every symbol in its geometry has a value.
        q: positions, as for `scene`.
        parameters: values of symbols. Other symbols have their default values.

    Raises:
        ModelError: `system` is not a System, a name is unknown, or a symbol has no value.
    """
    made = scene(system, q, parameters=parameters)
    at = pose_links(system, made.q, made.parameters)
    eye = _view(at, np.array(made.views["iso"]))
    # draw links as bars, also if they have visual shapes
    out = made.hidden(("visual",))
    shapes = [
        replace(item, role="base" if item.link == 0 else "link")
        if item.role == "skeleton" and not isinstance(item, (SpanShape, SpringShape))
        else item
        for item in made.primitives
        if item.role not in out
    ]
    flat = np.vstack([np.reshape(s.points, (-1, 2)) for s in _strokes(shapes, eye)])
    extent = float(np.ptp(flat, axis=0).max())
    eye = _OrthographicView(eye.axes, eye.caption, eye.poses, _SIZE / extent)
    strokes = [*_grounds(at, eye), *_strokes(shapes, eye), *_masses(at, eye)]
    return Drawing(tuple(strokes), placed(_names(at, eye)), eye.caption)


def _view(at: PosedLinks, iso: Array) -> _OrthographicView:
    """Return the view along the normal of the plane of motion, or from `iso` if it is spatial.

    `iso` is the unit vector (3,) towards the viewer in the base frame. In the plane, positive
    directions point to the right and upwards.
    """
    normal = plane_normal(at)
    prismatic_axes = [
        at.directions[axis.direction]
        for joint in at.parts.joints
        for axis in joint.axes
        if axis.motion == "prismatic"
    ]
    if normal is None or any(abs(float(along @ normal)) > _PARALLEL for along in prismatic_axes):
        right = np.cross(at.up, iso) / np.linalg.norm(np.cross(at.up, iso))
        axes = np.array([right, np.cross(iso, right), iso])
        return _OrthographicView(axes, "seen from above at an angle", at.poses)
    up = at.up - normal * (at.up @ normal)
    if np.linalg.norm(up) < _PARALLEL:  # the plane is level
        up = np.eye(3)[1] if abs(normal[1]) < 0.5 else np.eye(3)[2]
        up = up - normal * (up @ normal)
    up = up / np.linalg.norm(up)
    right = np.cross(up, normal)
    right = right * np.sign(right[np.argmax(np.abs(right))])
    axes = np.array([right, up, np.cross(right, up)])
    return _OrthographicView(axes, "in the plane of the motion", at.poses)


def _strokes(shapes: Iterable[Primitive], eye: _OrthographicView) -> Iterator[Stroke]:
    """Yield the strokes of all shapes ordered by role, and from far to near within a role."""
    drawn = []
    for item in shapes:
        group = _ORDER.index("joint" if item.role == "loop" else item.role)
        parts, depth = _parts(item, eye)
        drawn.append((group, depth, parts))
    for _, _, parts in sorted(drawn, key=lambda row: (row[0], row[1])):
        yield from parts


def _parts(item: Primitive, eye: _OrthographicView) -> tuple[list[Stroke], float]:
    """Return the strokes of a shape and its depth, the coordinate towards the viewer."""
    if isinstance(item, (SpanShape, SpringShape)):
        start, end = (eye.project(k, at) for k, at in zip(item.links, item.ends, strict=True))
        middle = float((start + end)[2]) / 2
        if isinstance(item, SpringShape):
            return [_coil(item, start, end, eye.scale * item.radius)], middle
        return [_area(item, _capsule([start, end], eye.scale * item.radius))], middle
    if isinstance(item, BarShape):
        ends = list(eye.project(item.link, (item.a, item.b)))
        area = _area(item, _capsule(ends, eye.scale * item.radius))
        return [area], float((ends[0] + ends[1])[2]) / 2
    if isinstance(item, BallShape):
        center = eye.project(item.link, item.at)
        ring = center[:2] + eye.scale * item.radius * _CIRCLE[:, :2]
        return [_area(item, ring)], float(center[2])
    if isinstance(item, CylinderShape):
        return _cylinder(item, eye)
    if isinstance(item, BoxShape):
        return _box(item, eye)
    if isinstance(item, PlateShape):
        corners = eye.project(item.link, item.points)
        return [_area(item, corners[:, :2], item.opacity)], float(corners[:, 2].mean()) - _SIZE
    if isinstance(item, RingShape):
        around = item.radius * _CIRCLE @ rotation_onto(np.array(item.axis)).T + np.array(item.at)
        points = eye.project(item.link, around)
        tube = 2 * eye.scale * item.tube
        line = Stroke(item.role, item.colour, _path(points), closed=True, width=tube)
        return [line], float(points[:, 2].mean())
    if isinstance(item, FrameShape):
        return _frame_axes(item, eye)
    assert isinstance(item, AxisShape), f"{type(item).__name__} has no strokes"
    ends = list(eye.project(item.link, (item.a, item.b)))
    # thin line (drawing units); no line for an axis along the view direction
    line = Stroke(item.role, item.colour, _path(np.array(ends)), width=0.3)
    long = math.dist(*line.points) > 0.01 * _SIZE
    return [line] * long, float((ends[0] + ends[1])[2]) / 2


def _area(item: Primitive, points: Array, opacity: float = 1.0, bright: float = 1.0) -> Stroke:
    """Return a polygon with corners `points` (k, 2 or 3), in role and colour of a primitive.

    `bright` is its brightness relative to the colour.
    """
    path = _path(points)
    return Stroke(item.role, item.colour, path, closed=True, opacity=opacity, bright=bright)


def _capsule(ends: Sequence[Array], radius: float) -> Array:
    """Return the outline (k, 2) of a bar with round ends: convex hull of circles about its ends."""
    return hull(np.vstack([end[:2] + radius * _CIRCLE[:, :2] for end in ends]))


def _cylinder(item: CylinderShape, eye: _OrthographicView) -> tuple[list[Stroke], float]:
    """Return the outline of a cylinder, its visible end face and bore, and its depth."""
    a, b = np.array(item.a), np.array(item.b)
    across = _CIRCLE @ rotation_onto(b - a).T
    rings = [eye.project(item.link, end + item.radius * across) for end in (a, b)]
    heads = [ring[:, 2].mean() for ring in rings]
    near = int(heads[1] > heads[0])
    # an end is visible if the axis is more than 3 degrees out of the picture plane; it is lighter
    # than the outline
    parts = [_area(item, hull(np.vstack(rings)[:, :2]))]
    if abs(heads[1] - heads[0]) > 0.05 * eye.scale * np.linalg.norm(b - a):
        parts.append(_area(item, rings[near][:, :2], bright=1.12))
        if item.bore > 0:
            bore = eye.project(item.link, (a, b)[near] + item.bore * across)
            parts.append(_area(item, bore[:, :2], bright=0.5))
    return parts, float(sum(heads)) / 2


def _box(item: BoxShape, eye: _OrthographicView) -> tuple[list[Stroke], float]:
    """Return the visible faces of a box, and its depth."""
    pose = np.array(item.pose).reshape(3, 4)
    local = BOX_CORNERS * np.array(item.size) @ pose[:, :3].T + pose[:, 3]
    corners = eye.project(item.link, local)
    parts = []
    # faces seen edge-on are left out; brightness is 0.9 of that of bars plus the light on the face
    for side in BOX_FACES:
        outside = np.cross(corners[side[2]] - corners[side[0]], corners[side[3]] - corners[side[1]])
        size = float(np.linalg.norm(outside))
        if outside[2] > 1e-3 * size:  # the face points to the eye
            bright = round(0.9 + float(outside @ _LIGHT) / size, 2)
            parts.append(_area(item, corners[list(side), :2], bright=bright))
    return parts, float(corners[:, 2].mean())


def _frame_axes(item: FrameShape, eye: _OrthographicView) -> tuple[list[Stroke], float]:
    """Return the axes of a frame except an axis that points to the viewer, and its depth."""
    pose = np.array(item.pose).reshape(3, 4)
    ends = pose[:, 3] + item.length * pose[:, :3].T
    points = eye.project(item.link, np.vstack([pose[:, 3], ends]))
    # an axis within 3 degrees of the view direction would be a dot
    lines = [
        Stroke(item.role, f"{item.colour}.{k}", _path(points[[0, k + 1]]), width=0.6)
        for k in range(3)
        if math.dist(points[0, :2], points[k + 1, :2]) > 0.05 * eye.scale * item.length
    ]
    return lines, float(points[0, 2])


def _coil(item: SpringShape, start: Array, end: Array, radius: float) -> Stroke:
    """Return a spring between two projected points as a zigzag of half width `radius`.

    It is a line if `start` and `end` (3,) coincide in the drawing. Lengths are in drawing units.
    """
    start, along = start[:2], (end - start)[:2]
    length = float(np.linalg.norm(along))
    # length below 1e-9 drawing units is rounding; straight ends of 3/20 of the length and eight
    # corners between them
    if length < 1e-9:
        return Stroke(item.role, item.colour, _path(np.array([start, end[:2]])), width=0.8)
    across = np.array([-along[1], along[0]]) / length
    swing = [0.0, 0.0, *(radius * (-1.0) ** k for k in range(8)), 0.0, 0.0]
    shares = [0.0, 0.15, *np.linspace(0.2, 0.8, 8), 0.85, 1.0]
    points = [start + s * along + w * across for s, w in zip(shares, swing, strict=True)]
    return Stroke(item.role, item.colour, _path(np.array(points)), width=0.8)


def _grounds(at: PosedLinks, eye: _OrthographicView) -> Iterator[Stroke]:
    """Yield a hatched ground line under every end of a force element on the base."""
    # lengths in drawing units
    for force in at.parts.forces:
        for link, column in zip(force.links, force.points, strict=True):
            if link == 0:
                x, y, _ = eye.seen(at.points[column])
                yield Stroke("base", "base", ((x - 4, y), (x + 4, y)))
                for head in (x - 3, x - 1, x + 1, x + 3):
                    yield Stroke("base", "base", ((head, y), (head - 1.4, y - 1.8)))


def _masses(at: PosedLinks, eye: _OrthographicView) -> Iterator[Stroke]:
    """Yield a dot at the centre of mass of every link."""
    for link in at.parts.links:
        if link.mass_centre is not None:
            # dot with a diameter of 1.6 drawing units
            dot = eye.seen(at.points[link.mass_centre])[:2] + 0.8 * _CIRCLE[:, :2]
            yield Stroke("mass", "text", _path(dot), closed=True, opacity=1.0)


def _names(at: PosedLinks, eye: _OrthographicView) -> Iterator[Name]:
    """Yield the names of joints, links, frames and force elements at their points."""

    def name(colour: str, text: str, columns: Sequence[int]) -> Name:
        middle = eye.seen(at.points[list(columns)].mean(axis=0))
        return Name(colour, text, (float(middle[0]), float(middle[1])))

    for joint in at.parts.joints:
        if joint.kind not in ("free", "fixed"):
            end = joint.points[1 if joint.kind == "rollingdisc" else 0]  # at the wheel
            yield name("loop" if joint.cut else "text", joint.name, (end,))
    for link in at.parts.links:
        columns = [k for segment in link.segments for k in segment]
        columns = columns or ([] if link.mass_centre is None else [link.mass_centre])
        if columns and link.bodies:
            yield name("axis", ", ".join(link.bodies), columns)
    for frame in at.parts.frames:
        if not frame.name.startswith("link "):
            yield name("axes.2", frame.name, (frame.origin,))
    for force in at.parts.forces:
        yield name("force", force.name, force.points)


# Placement of names next to points without overlaps.

_WIDTH = 0.58  # mean width of a letter relative to its height
_Room = tuple[float, float, float, float]
_SHIFTS = ((4.0, 2.4), (4.0, -5.0), (-4.0, 2.4), (-4.0, -5.0), (0.0, 5.4), (0.0, -8.0))
"""Offsets of a name from its point that are tried, in drawing units, outside the joint symbol."""
_FURTHER = (1.0, 1.8, 2.8)
"""Factors of these offsets, tried in order until the name has room."""
_SIGN = 3.0  # half the side of the square that a joint symbol occupies [drawing units]


def placed(names: Iterable[Name]) -> tuple[Name, ...]:
    """Place names next to their points without overlaps.

    Names of the same colour at the same point are joined by commas.

    Args:
        names: texts at the points to which they belong.

    Returns:
        Texts at their lower left corners [drawing units]. A text that has no free position
        overlaps.
    """
    groups: dict[tuple[str, Point], list[str]] = {}
    for name in names:
        key = name.colour, (round(name.point[0], 1), round(name.point[1], 1))
        groups.setdefault(key, []).append(name.text)
    taken: list[_Room] = [
        (x - _SIGN, y - _SIGN, x + _SIGN, y + _SIGN)
        for colour, (x, y) in groups
        if colour in ("text", "loop")
    ]
    found = []
    for (colour, point), texts in groups.items():
        text = ", ".join(dict.fromkeys(texts))
        corner, room = _free_room(text, point, taken)
        taken.append(room)
        found.append(Name(colour, text, corner))
    return tuple(found)


def _free_room(text: str, point: Point, taken: list[_Room]) -> tuple[Point, _Room]:
    """Return lower left corner and rectangle of the first free position of a text.

    If none is free, return the first position. `taken` are occupied rectangles (left, lower, right,
    upper).
    """
    tried = [
        _room(text, point, (dx * far, dy * far))
        for far, (dx, dy) in itertools.product(_FURTHER, _SHIFTS)
    ]
    return next((t for t in tried if not any(_overlap(t[1], room) for room in taken)), tried[0])


def _room(text: str, point: Point, shift: Point) -> tuple[Point, _Room]:
    """Return lower left corner and rectangle of a text at an offset `shift` from its point.

    The text ends at the offset if it is to the left, and is centred for an offset without x.
    """
    width = _WIDTH * LETTERS * len(text)
    x, y = point[0] + shift[0], point[1] + shift[1]
    x -= width if shift[0] < 0 else width / 2 if shift[0] == 0 else 0.0
    return (x, y), (x, y, x + width, y + LETTERS)


def _overlap(a: _Room, b: _Room) -> bool:
    """Whether two rectangles a and b, each (left, lower, right, upper), overlap."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


# Geometry of the plane.


def _path(points: Array) -> tuple[Point, ...]:
    """Return the first two coordinates of points (k, 2 or 3) as tuples."""
    return tuple((float(row[0]), float(row[1])) for row in points)


def hull(points: Array) -> Array:
    """Return the convex hull of points in a plane.

    Source: Andrew 1979, monotone chain algorithm.

    Args:
        points: points (k, 2).

    Returns:
        Corners (m, 2), counterclockwise.
    """
    rows = sorted({(round(float(x), 9), round(float(y), 9)) for x, y in points})
    lower, upper = _chain(rows), _chain(rows[::-1])
    return np.array(lower[:-1] + upper[:-1] or rows)


def _chain(rows: list[Point]) -> list[Point]:
    """Return the lower hull of points sorted by x (the upper hull if the order is reversed)."""
    chain: list[Point] = []
    for row in rows:
        while len(chain) > 1 and _signed_area(chain[-2], chain[-1], row) <= 0:
            chain.pop()
        chain.append(row)
    return chain


def _signed_area(a: Point, b: Point, c: Point) -> float:
    """Return twice the signed area of the triangle a, b, c: positive if counterclockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
