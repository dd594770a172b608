"""What links, the base and frames look like."""

from __future__ import annotations

from collections.abc import Iterator

import casadi
import numpy as np

from mbs.components import Box as BoxBody
from mbs.components import Cylinder as CylinderBody
from mbs.expressions import Scalar, to_float
from mbs.models.link_outline import link_outline
from mbs.models.skeleton import SkeletonLink
from mbs.view.measures import Measures
from mbs.view.palette import link_colour
from mbs.view.posed import Array, Posed, rows, three
from mbs.view.primitives import Ball, Bar, Box, Cylinder, Frame, Plate, Primitive

_THIN = 0.35


def solid_shapes(scene: Posed) -> Iterator[Box | Cylinder]:
    """The bodies that were described by their dimensions, as they are."""
    for body in scene.system.bodies:
        if body.solid is not None:
            pose = _body_pose(scene, body.name)
            shape = _solid(scene, body.link, pose, body.solid)
            if shape is not None:
                yield shape


def _body_pose(scene: Posed, name: str) -> Array:
    """(3, 4) pose of the reference frame of a body in its link's frame."""
    system = scene.system
    _, place = system.frames[name]
    both = casadi.densify(casadi.horzcat(place.R, place.p))
    pose_of = casadi.Function("pose", [system.p], [both])
    pose: Array = np.array(pose_of(list(scene.parameters.values())))
    return pose


def _solid(
    scene: Posed, link: int, pose: Array, body: BoxBody | CylinderBody
) -> Box | Cylinder | None:
    def number(scalar: Scalar | None) -> float:
        value = None if scalar is None else to_float(scalar, scene.parameters)
        return float("nan") if value is None else value

    length, colour = number(body.length), link_colour(link)
    R, left = pose[:, :3], pose[:, 3]
    right = left + length * R[:, 0]
    if isinstance(body, CylinderBody):
        radius, bore = number(body.radius), number(body.inner_radius)
        shape = Cylinder("link", link, colour, three(left), three(right), radius, bore)
        return shape if np.isfinite([length, radius, bore]).all() else None
    size = length, number(body.width), number(body.height)
    middle = np.column_stack([R, (left + right) / 2])
    return Box("link", link, colour, rows(middle), size) if np.isfinite(size).all() else None


def corners(scene: Posed, solid: Box | Cylinder) -> Array:
    """(k, 3) points of the base frame that span a solid."""
    R, p = scene.poses[solid.link, :, :3], scene.poses[solid.link, :, 3]
    if isinstance(solid, Cylinder):
        return np.array([solid.a, solid.b]) @ R.T + p
    pose = np.array(solid.pose).reshape(3, 4)
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    ends: Array = (signs * np.array(solid.size) / 2 @ pose[:, :3].T + pose[:, 3]) @ R.T + p
    return ends


def link_shapes(scene: Posed, sizes: Measures, solids: list[Box | Cylinder]) -> Iterator[Primitive]:
    """Bars from joint to joint, polygons filled, balls where a link is nothing but a point."""
    for link in scene.parts.links[1:]:
        own = [solid for solid in solids if solid.link == link.number]
        colour = link_colour(link.number)
        for a, b in link.segments:
            ends = [scene.local(link.number, scene.points[k]) for k in (a, b)]
            if not any(all(_holds(solid, end, sizes) for end in ends) for solid in own):
                yield Bar("link", link.number, colour, ends[0], ends[1], sizes.bar)
        yield from _plate(scene, link)
        if not link.segments and not own:
            yield from _point_link(scene, link, sizes)


def _holds(solid: Box | Cylinder, point: tuple[float, ...], sizes: Measures) -> bool:
    """Whether a point of the link lies in a solid."""
    slack, at = 1e-6 * sizes.size, np.array(point)
    if isinstance(solid, Box):
        pose = np.array(solid.pose).reshape(3, 4)
        inside = np.abs(pose[:, :3].T @ (at - pose[:, 3])) <= np.array(solid.size) / 2 + slack
        return bool(inside.all())
    a, b = np.array(solid.a), np.array(solid.b)
    length = float(np.linalg.norm(b - a))
    along = float((at - a) @ (b - a)) / length
    away = float(np.linalg.norm(at - a - along * (b - a) / length))
    return -slack <= along <= length + slack and away <= solid.radius + slack


def _plate(scene: Posed, link: SkeletonLink) -> Iterator[Plate]:
    segments = link.segments
    ends = [k for k, (_, b) in enumerate(segments) if b == segments[0][0]]
    if len(segments) > 2 and ends and ends[0] > 1:
        ring = segments[: ends[0] + 1]
        points = tuple(scene.local(link.number, scene.points[a]) for a, _ in ring)
        yield Plate("link", link.number, link_colour(link.number), points, _THIN)


def _point_link(scene: Posed, link: SkeletonLink, sizes: Measures) -> Iterator[Ball | Bar]:
    """A link without extent: a ball where only a mass is, a flange where a joint carries it."""
    number, colour = link.number, link_colour(link.number)
    held = [
        scene.points[point]
        for joint in scene.parts.joints
        for side, point in zip(joint.links, joint.points, strict=True)
        if side == number and joint.kind != "free"
    ]
    frames = [f for f in scene.parts.frames if f.link == number]
    if link.mass_centre is not None and not held:
        at = scene.local(number, scene.points[link.mass_centre])
        yield Ball("link", number, colour, at, 2.5 * sizes.bar)
    elif held and (frames or len(held) == 1):
        a = scene.local(number, held[0])
        yield Bar("link", number, colour, a, (a[0], a[1], a[2] + 2.2 * sizes.joint), sizes.bar)


def base_shapes(scene: Posed, sizes: Measures, floor: float) -> Iterator[Primitive]:
    """The base: bars between its joints, a column below the only one."""
    points = [
        scene.points[point]
        for joint in scene.parts.joints
        for link, point in zip(joint.links, joint.points, strict=True)
        if link == 0 and joint.kind not in ("free", "rollingdisc")
    ]
    if not points:
        return
    held = np.array(points)
    for a, b in link_outline(held, len(held)):
        yield Bar("base", 0, "base", three(held[a]), three(held[b]), 1.1 * sizes.bar)
    if np.ptp(held, axis=0).max() <= 1e-9 * sizes.size:
        yield from _column(scene, sizes, held[0], floor)


def _column(scene: Posed, sizes: Measures, top: Array, floor: float) -> Iterator[Cylinder]:
    foot = top + (floor - float(top @ scene.up)) * scene.up
    pad = foot + 0.5 * sizes.joint * scene.up
    if np.linalg.norm(top - foot) > 1e-9 * sizes.size:
        yield Cylinder("base", 0, "base", three(foot), three(top), 0.8 * sizes.joint)
        yield Cylinder("base", 0, "base", three(foot), three(pad), 2.4 * sizes.joint)


def frame_shapes(scene: Posed, sizes: Measures) -> Iterator[Frame]:
    """The base frame and those that have a name; then the frame of every link."""
    identity = tuple(float(x) for x in np.eye(3, 4).ravel())
    yield Frame("frame", 0, identity, sizes.frame)
    for frame in scene.parts.frames:
        R = scene.directions[list(frame.directions)].T
        pose = scene.local_pose(frame.link, R, scene.points[frame.origin])
        yield Frame("frame", frame.link, pose, sizes.frame)
    for number in range(1, len(scene.poses)):
        yield Frame("link frame", number, identity, 0.75 * sizes.frame)
