"""What joints, constraints and force elements look like."""

from __future__ import annotations

from collections.abc import Iterator

import casadi
import numpy as np

from mbs.assembly.khalil_frames import Cut
from mbs.components import RollingDisc
from mbs.components.motion import Motion
from mbs.expressions import to_float
from mbs.models.skeleton import SkeletonForce, SkeletonJoint
from mbs.view.measures import Measures
from mbs.view.mesh import turned_to
from mbs.view.posed import Array, PosedLinks
from mbs.view.primitives import (
    AxisShape,
    BallShape,
    BoxShape,
    CylinderShape,
    LabelShape,
    Primitive,
    RingShape,
    SpanShape,
    SpringShape,
    Vector,
)

_COILED = ("spring", "bushing")


def joint_shapes(scene: PosedLinks, sizes: Measures) -> Iterator[Primitive]:
    """Every joint: cylinders about axes, boxes along them, balls; and their names."""
    for joint in _shown(scene):
        if joint.kind == "rollingdisc":
            yield from _wheel(scene, joint, sizes)
            continue
        yield from _joined(scene, joint, sizes)
        yield from _axes(scene, joint, sizes)
    yield from _labels(scene, sizes)


def _shown(scene: PosedLinks) -> Iterator[SkeletonJoint]:
    """All but those that leave a body free, or weld it without closing a loop."""
    for joint in scene.parts.joints:
        if joint.kind != "free" and (joint.kind != "fixed" or joint.cut):
            yield joint


def _labels(scene: PosedLinks, sizes: Measures) -> Iterator[LabelShape]:
    """The names of joints, one above the other where they are at one place."""
    taken: list[Array] = []
    for joint in _shown(scene):
        side = 1 if joint.kind == "rollingdisc" else 0
        point = scene.points[joint.points[side]]
        row = sum(bool(np.linalg.norm(point - other) < sizes.joint) for other in taken)
        taken.append(point)
        at = scene.local(joint.links[side], point)
        yield LabelShape("label", joint.links[side], at, joint.name, row)


def _look(scene: PosedLinks, joint: SkeletonJoint) -> tuple[str, str]:
    """Role and colour."""
    if joint.cut:
        return "loop", "loop"
    driven = any(c.actuated for c in scene.system.speeds if c.joint == joint.name)
    return "joint", "active" if driven else "joint"


def _joined(scene: PosedLinks, joint: SkeletonJoint, sizes: Measures) -> Iterator[Primitive]:
    """A bar between frames that are not one place, balls where a joint has no axes."""
    role, colour = _look(scene, joint)
    a, b = (scene.points[k] for k in joint.points)
    ends = scene.local(joint.links[0], a), scene.local(joint.links[1], b)
    slides = any(axis.motion == "prismatic" for axis in joint.axes)
    if slides or np.linalg.norm(a - b) > 1e-6 * sizes.size or joint.cut:
        paint = colour if joint.cut or not slides else "joint"
        yield SpanShape(role, joint.links, paint, ends, 0.45 * sizes.bar)
    if not joint.axes:
        for link, end in dict(zip(joint.links, ends, strict=True)).items():
            yield BallShape(role, link, colour, end, 1.15 * sizes.joint)


def _axes(scene: PosedLinks, joint: SkeletonJoint, sizes: Measures) -> Iterator[Primitive]:
    role, colour = _look(scene, joint)
    carriers = _carriers(scene, joint)
    shrink = 1.0 if len(joint.axes) == 1 else 0.8
    for (link, column), axis in zip(carriers, joint.axes, strict=True):
        direction, center = scene.directions[axis.direction], scene.points[column]
        radius = shrink * sizes.joint
        if axis.motion == "revolute":
            a, b = _around(scene, link, center, 1.35 * radius * direction)
            yield CylinderShape(role, link, colour, a, b, radius)
        else:
            side = 1.9 * radius
            seat = _seat(scene, joint, direction, 1.5 * side)
            pose = scene.local_pose(link, turned_to(direction), center + seat)
            yield BoxShape(role, link, colour, pose, (side, side, 1.5 * side))
        a, b = _around(scene, link, center, 4.5 * sizes.joint * direction)
        yield AxisShape("axis", link, a, b)


def _carriers(scene: PosedLinks, joint: SkeletonJoint) -> list[tuple[int, int]]:
    """For each axis the link that it is fixed on, and the point that it goes through."""
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
    return scene.local(link, center - half), scene.local(link, center + half)


def _seat(scene: PosedLinks, joint: SkeletonJoint, direction: Array, length: float) -> Array:
    """Where a slide sits, seen from frame_b: beside a ball that is there too."""
    a, b = (scene.points[k] for k in joint.points)
    back = float((a - b) @ direction)
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
    cut = next(cut for cut in scene.system.cuts if cut.edge.joint.name == joint.name)
    disc = cut.edge.joint
    radius = to_float(disc.radius, scene.parameters) if isinstance(disc, RollingDisc) else None
    if radius is None or not isinstance(disc, RollingDisc):
        return
    link, center = joint.links[1], scene.points[joint.points[1]]
    axis = scene.poses[link, :, :3] @ _rotation(scene, cut) @ np.array(disc.axis, dtype=float)
    tube = min(0.06 * radius, 0.7 * sizes.joint)
    direction, at = scene.local_direction(link, axis), scene.local(link, center)
    yield RingShape("loop", link, "loop", at, direction, radius - tube, tube)


def _rotation(scene: PosedLinks, cut: Cut) -> Array:
    """Frame_b of a cut joint in its link's frame."""
    system = scene.system
    R = casadi.Function("R", [system.p], [casadi.densify(cut.pose_b.R)])
    return np.array(R([scene.parameters[p.name] for p in system.parameters]))


def force_shapes(scene: PosedLinks, sizes: Measures) -> Iterator[Primitive]:
    """Springs as coils, other elements between two points as bars."""
    for force in scene.parts.forces:
        a, b = (scene.points[k] for k in force.points)
        ends = scene.local(force.links[0], a), scene.local(force.links[1], b)
        yield _element(force, ends, float(np.linalg.norm(a - b)), sizes)


def _element(
    force: SkeletonForce, ends: tuple[Vector, Vector], length: float, sizes: Measures
) -> SpringShape | SpanShape:
    if force.kind in _COILED:
        nominal = max(length, 4 * sizes.joint)
        return SpringShape("force", force.links, "force", ends, 0.8 * sizes.joint, nominal)
    return SpanShape("force", force.links, "force", ends, 0.35 * sizes.bar)
