"""What links, the base and frames look like."""

from __future__ import annotations

from collections.abc import Iterator

import casadi
import numpy as np

from mbs.components import Box, Cylinder
from mbs.expressions import Scalar, to_float
from mbs.models.link_outline import link_outline
from mbs.models.skeleton import SkeletonLink
from mbs.view.measures import Measures
from mbs.view.palette import link_colour
from mbs.view.posed import Array, PosedLinks, rows, three
from mbs.view.primitives import (
    BallShape,
    BarShape,
    BoxShape,
    CylinderShape,
    FrameShape,
    PlateShape,
    Primitive,
)

_THIN = 0.35


def solid_shapes(scene: PosedLinks) -> Iterator[BoxShape | CylinderShape]:
    """The bodies that were described by their dimensions, as they are."""
    for body in scene.system.bodies:
        if body.solid is not None:
            pose = _body_pose(scene, body.name)
            shape = _solid(scene, body.link, pose, body.solid)
            if shape is not None:
                yield shape


def _body_pose(scene: PosedLinks, name: str) -> Array:
    """(3, 4) pose of the reference frame of a body in its link's frame."""
    system = scene.system
    _, place = system.frames[name]
    both = casadi.densify(casadi.horzcat(place.R, place.p))
    pose_of = casadi.Function("pose", [system.p], [both])
    pose: Array = np.array(pose_of(list(scene.parameters.values())))
    return pose


def _solid(
    scene: PosedLinks, link: int, pose: Array, body: Box | Cylinder
) -> BoxShape | CylinderShape | None:
    def number(scalar: Scalar | None) -> float:
        value = None if scalar is None else to_float(scalar, scene.parameters)
        return float("nan") if value is None else value

    length, colour = number(body.length), link_colour(link)
    R, left = pose[:, :3], pose[:, 3]
    right = left + length * R[:, 0]
    if isinstance(body, Cylinder):
        radius, bore = number(body.radius), number(body.inner_radius)
        shape = CylinderShape("link", link, colour, three(left), three(right), radius, bore)
        return shape if np.isfinite([length, radius, bore]).all() else None
    size = length, number(body.width), number(body.height)
    middle = np.column_stack([R, (left + right) / 2])
    return BoxShape("link", link, colour, rows(middle), size) if np.isfinite(size).all() else None


def corners(scene: PosedLinks, solid: BoxShape | CylinderShape) -> Array:
    """(k, 3) points of the base frame that span a solid."""
    R, p = scene.poses[solid.link, :, :3], scene.poses[solid.link, :, 3]
    if isinstance(solid, CylinderShape):
        return np.array([solid.a, solid.b]) @ R.T + p
    pose = np.array(solid.pose).reshape(3, 4)
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    ends: Array = (signs * np.array(solid.size) / 2 @ pose[:, :3].T + pose[:, 3]) @ R.T + p
    return ends


def link_shapes(
    scene: PosedLinks, sizes: Measures, solids: list[BoxShape | CylinderShape]
) -> Iterator[Primitive]:
    """Bars from joint to joint, polygons filled, balls where a link is nothing but a point."""
    for link in scene.parts.links[1:]:
        own = [solid for solid in solids if solid.link == link.number]
        colour = link_colour(link.number)
        for a, b in link.segments:
            ends = [scene.local(link.number, scene.points[k]) for k in (a, b)]
            if not any(all(_holds(solid, end, sizes) for end in ends) for solid in own):
                yield BarShape("link", link.number, colour, ends[0], ends[1], sizes.bar)
        yield from _plate(scene, link)
        if not link.segments and not own:
            yield from _point_link(scene, link, sizes)


def _holds(solid: BoxShape | CylinderShape, point: tuple[float, ...], sizes: Measures) -> bool:
    """Whether a point of the link lies in a solid."""
    slack, at = 1e-6 * sizes.size, np.array(point)
    if isinstance(solid, BoxShape):
        pose = np.array(solid.pose).reshape(3, 4)
        inside = np.abs(pose[:, :3].T @ (at - pose[:, 3])) <= np.array(solid.size) / 2 + slack
        return bool(inside.all())
    a, b = np.array(solid.a), np.array(solid.b)
    length = float(np.linalg.norm(b - a))
    along = float((at - a) @ (b - a)) / length
    away = float(np.linalg.norm(at - a - along * (b - a) / length))
    return -slack <= along <= length + slack and away <= solid.radius + slack


def _plate(scene: PosedLinks, link: SkeletonLink) -> Iterator[PlateShape]:
    segments = link.segments
    ends = [k for k, (_, b) in enumerate(segments) if b == segments[0][0]]
    if len(segments) > 2 and ends and ends[0] > 1:
        ring = segments[: ends[0] + 1]
        points = tuple(scene.local(link.number, scene.points[a]) for a, _ in ring)
        yield PlateShape("link", link.number, link_colour(link.number), points, _THIN)


def _point_link(
    scene: PosedLinks, link: SkeletonLink, sizes: Measures
) -> Iterator[BallShape | BarShape]:
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
        yield BallShape("link", number, colour, at, 2.5 * sizes.bar)
    elif held and (frames or len(held) == 1):
        a = scene.local(number, held[0])
        yield BarShape("link", number, colour, a, (a[0], a[1], a[2] + 2.2 * sizes.joint), sizes.bar)


def base_shapes(scene: PosedLinks, sizes: Measures, floor: float) -> Iterator[Primitive]:
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
        yield BarShape("base", 0, "base", three(held[a]), three(held[b]), 1.1 * sizes.bar)
    if np.ptp(held, axis=0).max() <= 1e-9 * sizes.size:
        yield from _column(scene, sizes, held[0], floor)


def _column(
    scene: PosedLinks, sizes: Measures, top: Array, floor: float
) -> Iterator[CylinderShape]:
    foot = top + (floor - float(top @ scene.up)) * scene.up
    pad = foot + 0.5 * sizes.joint * scene.up
    if np.linalg.norm(top - foot) > 1e-9 * sizes.size:
        yield CylinderShape("base", 0, "base", three(foot), three(top), 0.8 * sizes.joint)
        yield CylinderShape("base", 0, "base", three(foot), three(pad), 2.4 * sizes.joint)


def frame_shapes(scene: PosedLinks, sizes: Measures) -> Iterator[FrameShape]:
    """The base frame and those that have a name; then the frame of every link."""
    identity = tuple(float(x) for x in np.eye(3, 4).ravel())
    yield FrameShape("frame", 0, identity, sizes.frame)
    for frame in scene.parts.frames:
        R = scene.directions[list(frame.directions)].T
        pose = scene.local_pose(frame.link, R, scene.points[frame.origin])
        yield FrameShape("frame", frame.link, pose, sizes.frame)
    for number in range(1, len(scene.poses)):
        yield FrameShape("link frame", number, identity, 0.75 * sizes.frame)
