"""The drawing of a mechanism at its start posture: links as lines, joints as signs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import casadi
import numpy as np

from mbs.assembly import System
from mbs.export.fmu import signs
from mbs.export.fmu.figure import Figure, Point, Stroke, Style
from mbs.export.fmu.labels import placed
from mbs.export.fmu.projection import Array, Projection, projection
from mbs.models.skeleton import Skeleton, SkeletonJoint, SkeletonLink, skeleton

_SIZE = 100.0
_SAME = 0.2
"""Points of the drawing that are nearer than this are one."""

_HIDDEN = ("free", "fixed")


@dataclass(frozen=True, slots=True, eq=False)
class _Scene:
    """A skeleton placed and seen: points in the drawing, directions in space."""

    parts: Skeleton
    view: Projection
    points: Array
    directions: Array

    def at(self, column: int) -> Array:
        return np.array(self.points[column])


def figure(system: System, q: Sequence[float] | None = None) -> Figure:
    """The drawing of a system.

    Args:
        system: open or closed; every symbol in its geometry has a value.
        q: (nq,) positions; the assembled posture when left out.

    Returns:
        strokes and names.
    """
    scene = _scene(system, list(system.posture) if q is None else list(q))
    strokes = [*_links(scene), *_forces(scene), *_frames(scene), *_joints(scene), *_masses(scene)]
    return Figure(tuple(strokes), placed(_names(scene)), scene.view.caption)


def _scene(system: System, q: list[float]) -> _Scene:
    parts = skeleton(system)
    values = parts.function(q, system.parameter_values()) if system.parameters else None
    points, directions = (np.array(m).T for m in values or parts.function(q))
    gravity = casadi.Function("gravity", [system.p], [system.tree.gravity])
    down = np.array(gravity(system.parameter_values())).ravel()
    axes = {
        motion: np.array(
            [directions[a.direction] for j in parts.joints for a in j.axes if a.motion == motion]
        ).reshape(-1, 3)
        for motion in ("revolute", "prismatic")
    }
    ball = any(joint.kind in ("spherical", "free") for joint in parts.joints)
    turns = np.eye(3) if ball else axes["revolute"]
    every = np.vstack((np.zeros((1, 3)), points))
    view = projection(every, turns, axes["prismatic"], down)
    flat = view.of(points)
    extent = float(np.ptp(flat, axis=0).max()) if len(flat) else 0.0
    if {joint.kind for joint in parts.joints} <= {"free"}:
        extent *= 4.0  # nothing but bodies that float
    scale = _SIZE / extent if extent > 1e-12 else _SIZE
    return _Scene(parts, view, scale * flat, directions)


def _links(scene: _Scene) -> Iterator[Stroke]:
    for link in scene.parts.links:
        path = [scene.at(a) for a, _ in link.segments]
        if len(link.segments) > 2 and link.segments[0][0] == link.segments[-1][1]:
            yield Stroke("link", tuple((float(x), float(y)) for x, y in path), closed=True)
            continue
        for start, end in link.segments:
            yield signs.line("link", scene.at(start), scene.at(end))
        if link.mass_centre is not None and _is_alone(scene, link):
            yield signs.disc("link", scene.at(link.mass_centre), 12.0)
    for joint in scene.parts.joints:
        a, b = (scene.at(k) for k in joint.points)
        if joint.kind not in _HIDDEN and np.linalg.norm(a - b) > _SAME:
            yield signs.line("link", a, b)


def _is_alone(scene: _Scene, link: SkeletonLink) -> bool:
    """Whether only a free joint holds it."""
    kinds = {joint.kind for joint in scene.parts.joints if link.number in joint.links}
    return kinds <= {"free"}


def _forces(scene: _Scene) -> Iterator[Stroke]:
    for force in scene.parts.forces:
        yield signs.zigzag(*(scene.at(k) for k in force.points))


def _frames(scene: _Scene) -> Iterator[Stroke]:
    yield from signs.tripod(scene.view, np.zeros(2), np.eye(3), 9.0)
    for frame in scene.parts.frames:
        axes = scene.directions[list(frame.directions)]
        yield from signs.tripod(scene.view, scene.at(frame.origin), axes, 7.0)


def _joints(scene: _Scene) -> Iterator[Stroke]:
    grounded: list[Array] = []
    for joint in scene.parts.joints:
        if joint.kind in _HIDDEN:
            continue
        for number, column in zip(joint.links, joint.points, strict=True):
            at = scene.at(column)
            if number == 0 and all(np.linalg.norm(at - g) > _SAME for g in grounded):
                grounded.append(at)
                yield from signs.ground(at)
    for force in scene.parts.forces:
        for number, column in zip(force.links, force.points, strict=True):
            if number == 0:
                yield from signs.ground(scene.at(column))
    for joint in scene.parts.joints:
        yield from _sign(scene, joint)


def _sign(scene: _Scene, joint: SkeletonJoint) -> Iterator[Stroke]:
    style = _style(joint)
    a, b = (scene.at(k) for k in joint.points)
    for axis in joint.axes:
        draw = signs.cylinder if axis.motion == "revolute" else signs.slide
        yield from draw(style, scene.view, a, scene.directions[axis.direction])
    if not joint.axes and joint.kind not in _HIDDEN:
        yield signs.disc(style, a, 1.5)
        if np.linalg.norm(a - b) > _SAME:
            yield signs.disc(style, b, 1.5)


def _style(joint: SkeletonJoint) -> Style:
    return "closing" if joint.cut else "joint"


def _masses(scene: _Scene) -> Iterator[Stroke]:
    for link in scene.parts.links:
        if link.mass_centre is not None:
            yield signs.disc("mass", scene.at(link.mass_centre), 0.8)


def _names(scene: _Scene) -> Iterator[tuple[Style, str, Point]]:
    for joint in scene.parts.joints:
        if joint.kind not in _HIDDEN:
            yield _style(joint), joint.name, _point(scene.at(joint.points[0]))
    for link in scene.parts.links:
        columns = [k for segment in link.segments for k in segment]
        columns = columns or ([] if link.mass_centre is None else [link.mass_centre])
        if columns and link.bodies:
            middle = np.mean([scene.at(k) for k in columns], axis=0)
            yield "link", ", ".join(link.bodies), _point(middle)
    for frame in scene.parts.frames:
        if not frame.name.startswith("link "):
            yield "frame", frame.name, _point(scene.at(frame.origin))
    for force in scene.parts.forces:
        middle = (scene.at(force.points[0]) + scene.at(force.points[1])) / 2
        yield "force", force.name, _point(middle)


def _point(at: Array) -> Point:
    return float(at[0]), float(at[1])
