"""Shapes of links, joints, force elements and frames in a scene."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import casadi
import numpy as np
from numpy.typing import NDArray

from mbs.components import Box, Cylinder, RollingDisc
from mbs.components.description import OUTER_WORLD
from mbs.components.joints import Motion
from mbs.components.shapes import Shape
from mbs.errors import ModelError
from mbs.expressions import Scalar, to_float
from mbs.models.skeleton import SkeletonForce, SkeletonJoint, SkeletonLink, link_outline
from mbs.spatial import Pose
from mbs.text import shortened
from mbs.view.mesh import revolve
from mbs.view.mesh_files import read_mesh
from mbs.view.posed import SAME_POINT, Array, Measures, PosedLinks, rows, three
from mbs.view.primitives import (
    AxisShape,
    BallShape,
    BarShape,
    BoxShape,
    CylinderShape,
    FrameShape,
    LabelShape,
    MeshShape,
    PlateShape,
    Primitive,
    RingShape,
    SpanShape,
    SpringShape,
    Vector,
    link_colour,
    rotation_onto,
)


def joint_shapes(scene: PosedLinks, sizes: Measures) -> Iterator[Primitive]:
    """Yield the shapes and names of the joints.

    Revolute axes are cylinders, prismatic axes boxes, and joints without axes spheres. A rolling
    disc is a ring.

    Args:
        scene: posed links.
        sizes: sizes of shapes without own dimensions.
    """
    for joint in _shown(scene):
        if joint.kind == "rollingdisc":
            yield from _wheel(scene, joint, sizes)
            continue
        yield from _bar_and_spheres(scene, joint, sizes)
        yield from _axes(scene, joint, sizes)
    yield from _labels(scene, sizes)


def _shown(scene: PosedLinks) -> Iterator[SkeletonJoint]:
    """Yield the joints to draw: not free joints, and fixed joints only if they close loops."""
    for joint in scene.parts.joints:
        if joint.kind != "free" and (joint.kind != "fixed" or joint.cut):
            yield joint


def _labels(scene: PosedLinks, sizes: Measures) -> Iterator[LabelShape]:
    """Yield the names of joints. Names of joints at the same point are placed above each other."""
    taken: list[Array] = []
    for joint in _shown(scene):
        side = 1 if joint.kind == "rollingdisc" else 0
        point = scene.points[joint.points[side]]
        row = sum(bool(np.linalg.norm(point - other) < sizes.joint) for other in taken)
        taken.append(point)
        at = scene.local(joint.links[side], point)
        yield LabelShape("label", joint.links[side], at, joint.name, row)


def _look(scene: PosedLinks, joint: SkeletonJoint) -> tuple[str, str]:
    """Return role and palette colour of a joint, which depend on whether it is cut or actuated."""
    if joint.cut:
        return "loop", "loop"
    driven = any(c.actuated for c in scene.system.velocity_coordinates if c.joint == joint.name)
    return "joint", "active" if driven else "joint"


def _bar_and_spheres(
    scene: PosedLinks, joint: SkeletonJoint, sizes: Measures
) -> Iterator[Primitive]:
    """Yield a bar between the two frames of a joint if they differ, and spheres without axes."""
    role, colour = _look(scene, joint)
    a, b = (scene.points[k] for k in joint.points)
    ends = scene.local(joint.links[0], a), scene.local(joint.links[1], b)
    # thinner than links, spheres a little larger than joints with axes
    is_prismatic = any(axis.motion == "prismatic" for axis in joint.axes)
    if is_prismatic or np.linalg.norm(a - b) > SAME_POINT * sizes.size or joint.cut:
        paint = colour if joint.cut or not is_prismatic else "joint"
        yield SpanShape(role, joint.links, paint, ends, 0.45 * sizes.bar)
    if not joint.axes:
        for link, end in dict(zip(joint.links, ends, strict=True)).items():
            yield BallShape(role, link, colour, end, 1.15 * sizes.joint)


def _axes(scene: PosedLinks, joint: SkeletonJoint, sizes: Measures) -> Iterator[Primitive]:
    """Yield a cylinder or box and a dashed line for each axis of a joint."""
    role, colour = _look(scene, joint)
    carriers = _carriers(scene, joint)
    # lengths in joint radii: several axes are smaller, so that all are visible; the box of a
    # prismatic joint has about the volume of the cylinder of a revolute joint
    shrink = 1.0 if len(joint.axes) == 1 else 0.8
    for (link, column), axis in zip(carriers, joint.axes, strict=True):
        direction, center = scene.directions[axis.direction], scene.points[column]
        radius = shrink * sizes.joint
        if axis.motion == "revolute":
            a, b = _around(scene, link, center, 1.35 * radius * direction)
            yield CylinderShape(role, link, colour, a, b, radius)
        else:
            side = 1.9 * radius
            seat = _box_offset(scene, joint, direction, 1.5 * side)
            pose = scene.local_pose(link, rotation_onto(direction), center + seat)
            yield BoxShape(role, link, colour, pose, (side, side, 1.5 * side))
        a, b = _around(scene, link, center, 4.5 * sizes.joint * direction)
        yield AxisShape("axis", link, a, b)


def _carriers(scene: PosedLinks, joint: SkeletonJoint) -> list[tuple[int, int]]:
    """Return for each axis of a joint the number of its link and the index of a point on it."""
    if joint.cut:
        return [(joint.links[min(k, 1)], joint.points[min(k, 1)]) for k in range(len(joint.axes))]
    system = scene.system
    return [
        (number, joint.points[1])
        for number, link in enumerate(system.tree.links, start=1)
        if system.coordinates[link.q.start].joint == joint.name
        and link.motion in (Motion.REVOLUTE, Motion.PRISMATIC)
    ]


def _around(scene: PosedLinks, link: int, center: Array, half: Array) -> tuple[Vector, Vector]:
    """Return the points center - half and center + half of the base frame in a link frame."""
    return scene.local(link, center - half), scene.local(link, center + half)


def _box_offset(scene: PosedLinks, joint: SkeletonJoint, direction: Array, length: float) -> Array:
    """Return the offset (3,) of the box of a prismatic joint from frame_b, in the base frame [m].

    It is along the axis `direction` and keeps the box, of a given length, clear of the sphere of
    another joint.
    """
    a, b = (scene.points[k] for k in joint.points)
    back = float((a - b) @ direction)
    # limits in box lengths: towards a distant frame_a, else clear of a sphere near frame_b
    if abs(back) > 2.5 * length:
        return np.array(np.sign(back) * 1.1 * length * direction)
    crowded = any(
        np.linalg.norm(scene.points[k] - b) < 0.25 * length
        for other in scene.parts.joints
        if not other.axes and other.kind not in ("free", "fixed")
        for k in other.points
    )
    return np.array(-1.1 * length * direction if crowded else 0.0 * direction)


def _wheel(scene: PosedLinks, joint: SkeletonJoint, sizes: Measures) -> Iterator[Primitive]:
    """Yield the ring of a rolling disc; nothing if its radius has no value."""
    cut = next(cut for cut in scene.system.cuts if cut.edge.joint.name == joint.name)
    disc = cut.edge.joint
    radius = to_float(disc.radius, scene.parameters) if isinstance(disc, RollingDisc) else None
    if radius is None or not isinstance(disc, RollingDisc):
        return
    link, center = joint.links[1], scene.points[joint.points[1]]
    axis = (
        scene.poses[link, :, :3]
        @ _numeric(scene, cut.pose_b)[0, :, :3]
        @ np.array(disc.axis, dtype=float)
    )
    # radius of the tire, not thicker than joints
    tube = min(0.06 * radius, 0.7 * sizes.joint)
    direction, at = scene.local_direction(link, axis), scene.local(link, center)
    yield RingShape("loop", link, "loop", at, direction, radius - tube, tube)


def _numeric(scene: PosedLinks, *poses: Pose) -> Array:
    """Return poses (k, 3, 4) [R p] at the values of the symbols of a scene."""
    matrices = [casadi.densify(casadi.horzcat(pose.R, pose.p)) for pose in poses]
    flat = casadi.Function("poses", [scene.system.p], [casadi.horzcat(*matrices)])
    numbers: Array = np.array(flat(list(scene.parameters.values())))
    return numbers.reshape(3, -1, 4).swapaxes(0, 1)


def force_shapes(scene: PosedLinks, sizes: Measures) -> Iterator[Primitive]:
    """Yield springs as coils, and other force elements between two points as bars.

    Args:
        scene: posed links.
        sizes: sizes of shapes without own dimensions.
    """
    for force in scene.parts.forces:
        a, b = (scene.points[k] for k in force.points)
        ends = scene.local(force.links[0], a), scene.local(force.links[1], b)
        yield _element(force, ends, float(np.linalg.norm(a - b)), sizes)


def figures(scene: PosedLinks, notes: list[str]) -> Iterator[Visual]:
    """Yield the shapes that force elements, such as fans, define at their frames.

    Args:
        scene: posed links.
        notes: list to which a warning is appended for each missing or simplified mesh.
    """
    system = scene.system
    for part in system.parts:
        shapes = part.element.drawn(scene.parameters)
        for port, frame in zip(part.element.frames, part.frames, strict=True):
            if port in shapes:
                link, place = frame
                pose = _numeric(scene, place)[0]
                yield from _drawn(shapes[port], link + 1, "force", pose, notes, "force")


def _drawn(
    shape: Shape, link: int, colour: str, pose: Array, notes: list[str], role: str
) -> Iterator[Visual]:
    """Yield a shape of a body as a primitive; a mesh that cannot be read adds a note instead.

    `pose` (3, 4) is in the frame of link number `link`; `colour` is used if the shape has none.
    """
    if shape.colour is not None:
        colour = "#" + "".join(f"{round(255 * part):02x}" for part in shape.colour)
    try:
        yield _visual(shape, link, colour, pose, notes, role)
    except ModelError as error:
        if str(error) not in notes:
            notes.append(str(error))


def _element(
    force: SkeletonForce, ends: tuple[Vector, Vector], length: float, sizes: Measures
) -> SpringShape | SpanShape:
    """Return a force element between two points as a coil or a bar.

    `ends` are its end points in the link frames, `length` is their distance [m].
    """
    # diameters: springs are as wide as joints, other elements thinner
    if force.shape == "coil":
        nominal = max(length, 4 * sizes.joint)
        return SpringShape("force", force.links, "force", ends, 0.8 * sizes.joint, nominal)
    return SpanShape("force", force.links, "force", ends, 0.35 * sizes.bar)


# Shapes of links, the base and frames.


_THIN = 0.35
"""Opacity of the plate between the joints of a link. Its bars are visible through it."""


def solid_shapes(scene: PosedLinks) -> Iterator[BoxShape | CylinderShape]:
    """Yield the bodies that are defined by their dimensions (Box and Cylinder).

    Bodies with a dimension that has no value are left out.

    Args:
        scene: posed links.
    """
    for body in scene.system.bodies:
        if body.solid is not None:
            pose = _numeric(scene, scene.system.frames[body.name][1])[0]
            shape = _solid(scene, body.link, pose, body.solid)
            if shape is not None:
                yield shape


def _solid(
    scene: PosedLinks, link: int, pose: Array, body: Box | Cylinder
) -> BoxShape | CylinderShape | None:
    """Return a body as a box or cylinder; None if a dimension has no value.

    `pose` (3, 4) is the reference frame of the body in the frame of link number `link`.
    """

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


Visual = BoxShape | CylinderShape | BarShape | BallShape | MeshShape
"""Primitives that draw the shapes of bodies."""


def visual_shapes(scene: PosedLinks, notes: list[str]) -> Iterator[Visual]:
    """Yield the shapes of the links (`Mechanism.add_shape`, or from a robot file).

    Args:
        scene: posed links.
        notes: list to which a warning is appended for each missing or simplified mesh.
    """
    system = scene.system
    if not system.shapes:
        return
    poses = _numeric(scene, *(row.pose for row in system.shapes))
    for row, pose in zip(system.shapes, poses, strict=True):
        link = row.link + 1
        yield from _drawn(row.shape, link, link_colour(link), pose, notes, "visual")


def _visual(
    shape: Shape, link: int, colour: str, pose: Array, notes: list[str], role: str
) -> Visual:
    """Return a shape of a body as a primitive at a pose (3, 4) in the frame of link number `link`.

    `colour` and `role` are those of the primitive. `notes` receives a text for a simplified mesh.
    Raise a ModelError if a mesh cannot be read.
    """
    size, middle = shape.size, pose[:, 3]
    if shape.kind == "box":
        return BoxShape(role, link, colour, rows(pose), (size[0], size[1], size[2]))
    if shape.kind == "sphere":
        return BallShape(role, link, colour, three(middle), size[0])
    if shape.kind in ("cylinder", "capsule"):
        half = size[1] / 2 * pose[:, 2]
        ends = three(middle - half), three(middle + half)
        round_ends = shape.kind == "capsule"
        return (BarShape if round_ends else CylinderShape)(role, link, colour, *ends, size[0])
    if shape.kind == "ellipsoid":
        points, triangles = _unit_ball()
    else:
        assert shape.mesh is not None
        mesh = read_mesh(shape.mesh)
        points, triangles = mesh.points, mesh.triangles
        if mesh.of > len(triangles):
            name = shortened(str(shape.mesh))
            text = f"{name}: drawn with {len(triangles)} of its {mesh.of} triangles"
            if text not in notes:
                notes.append(text)
    return _surface(link, colour, pose, points * np.array(size), triangles, role)


def _surface(
    link: int, colour: str, pose: Array, points: Array, triangles: NDArray[np.int64], role: str
) -> MeshShape:
    """Return a triangle mesh as a primitive at a pose (3, 4) in the frame of link number `link`.

    `points` (n, 3) [m] are rounded to six digits of the largest one; `triangles` (m, 3) are indices
    of points.
    """
    # round to six digits of the largest coordinate, which is less than a pixel
    digits = 6 - int(np.ceil(np.log10(max(float(np.abs(points).max()), 1e-300))))
    flat = tuple(np.round(points, min(digits, 300)).ravel().tolist())
    return MeshShape(role, link, colour, rows(pose), flat, tuple(triangles.ravel().tolist()))


def _unit_ball() -> tuple[Array, NDArray[np.int64]]:
    """Return points (n, 3) and triangles (m, 3) of a sphere with the radius 1."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 9)
    faces = revolve(np.column_stack([np.cos(angle), np.sin(angle)]))
    numbers = np.arange(4 * len(faces)).reshape(-1, 4)
    return faces.reshape(-1, 3), np.vstack([numbers[:, :3], numbers[:, [0, 2, 3]]])


def corners(scene: PosedLinks, solid: Visual) -> Array:
    """Return points in the base frame that bound a shape of a body.

    Args:
        scene: posed links.
        solid: primitive on a link.

    Returns:
        Points (k, 3) [m].
    """
    R, p = scene.poses[solid.link, :, :3], scene.poses[solid.link, :, 3]
    if isinstance(solid, BallShape):
        around = solid.radius * np.vstack([np.eye(3), -np.eye(3)])
        return np.array(R @ np.array(solid.at) + p + around)
    if isinstance(solid, (CylinderShape, BarShape)):
        return np.array([solid.a, solid.b]) @ R.T + p
    pose = np.array(solid.pose).reshape(3, 4)
    if isinstance(solid, MeshShape):
        points = np.reshape(solid.points, (-1, 3))
        middle, half = (points.min(axis=0) + points.max(axis=0)) / 2, np.ptp(points, axis=0) / 2
    else:
        middle, half = np.zeros(3), np.array(solid.size) / 2
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    ends: Array = ((middle + signs * half) @ pose[:, :3].T + pose[:, 3]) @ R.T + p
    return ends


def link_shapes(
    scene: PosedLinks, sizes: Measures, solids: list[BoxShape | CylinderShape], seen: set[int]
) -> Iterator[Primitive]:
    """Yield links as bars between their joints, plates for polygons, spheres for point masses.

    Args:
        scene: posed links.
        sizes: sizes of shapes without own dimensions.
        solids: bodies that are defined by their dimensions. A bar inside a solid is left out.
        seen: numbers of links with visual shapes. Their bars get the role "skeleton".
    """
    for item in _bars(scene, sizes, solids):
        yield replace(item, role="skeleton") if item.link in seen else item


def _bars(
    scene: PosedLinks, sizes: Measures, solids: list[BoxShape | CylinderShape]
) -> Iterator[BarShape | BallShape | PlateShape]:
    """Yield the bars, plates and spheres of the links.

    Bars inside one of the `solids` are left out.
    """
    for link in scene.parts.links[1:]:
        own = [solid for solid in solids if solid.link == link.number]
        colour = link_colour(link.number)
        for a, b in link.segments:
            ends = [scene.local(link.number, scene.points[k]) for k in (a, b)]
            if not any(all(_contains(solid, end, sizes) for end in ends) for solid in own):
                yield BarShape("link", link.number, colour, ends[0], ends[1], sizes.bar)
        yield from _plate(scene, link)
        if not link.segments and not own:
            yield from _point_link(scene, link, sizes)


def _contains(solid: BoxShape | CylinderShape, point: tuple[float, ...], sizes: Measures) -> bool:
    """Whether a point (3,) in the link frame [m] is inside a solid."""
    slack, at = SAME_POINT * sizes.size, np.array(point)
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
    """Yield the plate of a link whose segments form a closed polygon."""
    segments = link.segments
    ends = [k for k, (_, b) in enumerate(segments) if b == segments[0][0]]
    if len(segments) > 2 and ends and ends[0] > 1:
        ring = segments[: ends[0] + 1]
        points = tuple(scene.local(link.number, scene.points[a]) for a, _ in ring)
        yield PlateShape("link", link.number, link_colour(link.number), points, _THIN)


def _point_link(
    scene: PosedLinks, link: SkeletonLink, sizes: Measures
) -> Iterator[BallShape | BarShape]:
    """Yield a link without extent: a sphere for a free mass, a short bar (flange) at a joint."""
    number, colour = link.number, link_colour(link.number)
    joints = [
        scene.points[point]
        for joint in scene.parts.joints
        for side, point in zip(joint.links, joint.points, strict=True)
        if side == number and joint.kind != "free"
    ]
    frames = [f for f in scene.parts.frames if f.link == number]
    # sphere of a body without joints, or short bar that is longer than the joint
    if link.mass_centre is not None and not joints:
        at = scene.local(number, scene.points[link.mass_centre])
        yield BallShape("link", number, colour, at, 2.5 * sizes.bar)
    elif joints and (frames or len(joints) == 1):
        a = scene.local(number, joints[0])
        yield BarShape("link", number, colour, a, (a[0], a[1], a[2] + 2.2 * sizes.joint), sizes.bar)


def base_shapes(
    scene: PosedLinks, sizes: Measures, floor: float, seen: set[int]
) -> Iterator[Primitive]:
    """Yield the base: bars between its joints, or a column if all joints are at one point.

    Args:
        scene: posed links.
        sizes: sizes of shapes without own dimensions.
        floor: height of the ground, along the direction against gravity from the base origin [m].
        seen: numbers of links with visual shapes. If it contains 0, the role is "skeleton".
    """
    for item in _base_bars(scene, sizes, floor):
        yield replace(item, role="skeleton") if 0 in seen else item


def _base_bars(
    scene: PosedLinks, sizes: Measures, floor: float
) -> Iterator[BarShape | CylinderShape]:
    """Yield bars between the joints of the base, or a column.

    `floor` is the height of the ground.
    """
    points = [
        scene.points[point]
        for joint in scene.parts.joints
        for link, point in zip(joint.links, joint.points, strict=True)
        if link == 0 and joint.kind not in ("free", "rollingdisc")
    ]
    if not points:
        return
    ends = np.array(points)
    # bars are thicker than links; a column if all joints are at one point, except for rounding
    for a, b in link_outline(ends, len(ends)):
        yield BarShape("base", 0, "base", three(ends[a]), three(ends[b]), 1.1 * sizes.bar)
    if np.ptp(ends, axis=0).max() <= 1e-9 * sizes.size:
        yield from _column(scene, sizes, ends[0], floor)


def _column(
    scene: PosedLinks, sizes: Measures, top: Array, floor: float
) -> Iterator[CylinderShape]:
    """Yield a column with a foot from the ground (height `floor` [m]) to the point `top` (3,)."""
    foot = top + (floor - float(top @ scene.up)) * scene.up
    if OUTER_WORLD in scene.system.frames:  # a mounted base need not be above the ground
        foot = np.zeros(3)
    height = float(np.linalg.norm(top - foot))
    # nearly as thick as a joint, on a foot three times as wide; no column for a joint on the ground
    if height > 1e-9 * sizes.size:
        pad = foot + min(0.5 * sizes.joint / height, 1.0) * (top - foot)
        yield CylinderShape("base", 0, "base", three(foot), three(top), 0.8 * sizes.joint)
        yield CylinderShape("base", 0, "base", three(foot), three(pad), 2.4 * sizes.joint)


def frame_shapes(scene: PosedLinks, sizes: Measures) -> Iterator[FrameShape]:
    """Yield the base frame and the named frames, then the frame of every link.

    Args:
        scene: posed links.
        sizes: sizes of shapes without own dimensions.
    """
    identity = tuple(float(x) for x in np.eye(3, 4).ravel())
    yield FrameShape("frame", 0, identity, sizes.frame)
    for frame in scene.parts.frames:
        R = scene.directions[list(frame.directions)].T
        pose = scene.local_pose(frame.link, R, scene.points[frame.origin])
        yield FrameShape("frame", frame.link, pose, sizes.frame)
    # axes shorter than the axes of named frames
    for number in range(1, len(scene.poses)):
        yield FrameShape("link frame", number, identity, 0.75 * sizes.frame)
