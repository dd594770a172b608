"""Skeleton of a mechanism: points, axes and lines for drawing, at any configuration."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function, require_system
from mbs.assembly.tables import JointRow
from mbs.assembly.tree import Frame, normalised
from mbs.components.description import OUTER_WORLD
from mbs.components.joints import Motion
from mbs.models.geometry import terminal_frame
from mbs.recursions.link_motions import base_poses, link_poses
from mbs.spatial import Pose

# Lines that represent a rigid link, between its joints and other points.


Array = NDArray[np.float64]

_SAME = 1e-9
"""Distance relative to the size of the link below which two points coincide [1]: rounding error."""

_WIDE = 1e-6
"""Width relative to the length below which points count as collinear [1]: rounding error."""


def link_outline(points: Array, held: int) -> list[tuple[int, int]]:
    """Return the lines that represent a rigid link, as pairs of point indices.

    Collinear joints are connected by a line from end to end, three or more other joints by a closed
    polygon. Each further point is connected to the nearest joint, unless it is inside the polygon.

    Args:
        points: (k, 3) points in the frame of the link [m]; the first `held` points are joints.
        held: number of joints.

    Returns:
        pairs of indices into `points`. Coincident points are represented by the first index.
    """
    size = float(np.abs(points - points[0]).max())
    kept = [k for k in range(len(points)) if _is_new(points, k, _SAME * max(size, 1.0))]
    corners = [k for k in kept if k < held]
    lines = _polygon(points, corners) if corners else []
    for k in (k for k in kept if k >= held):
        if not corners:
            corners = [k]
            continue
        near = min(corners, key=lambda m: float(np.linalg.norm(points[m] - points[k])))
        middle = points[corners].mean(axis=0)
        reach = float(np.linalg.norm(points[near] - middle))
        if len(corners) < 3 or float(np.linalg.norm(points[k] - middle)) > reach:
            lines.append((near, k))
    return lines


def _is_new(points: Array, k: int, apart: float) -> bool:
    """Return whether point k is farther than `apart` [m] from each previous point."""
    return bool(np.all(np.linalg.norm(points[:k] - points[k], axis=1) > apart))


def _polygon(points: Array, corners: list[int]) -> list[tuple[int, int]]:
    """Return the edges of a polygon through the points with indices `corners`.

    It is a line if they are collinear. Edges are pairs of indices of the points (n, 3).
    """
    away = points[corners] - points[corners].mean(axis=0)
    _, sizes, axes = np.linalg.svd(away)
    flat = away @ axes[:2].T
    if len(sizes) < 2 or sizes[1] <= _WIDE * sizes[0]:
        path = [corners[k] for k in np.argsort(flat[:, 0], kind="stable")]
        return list(itertools.pairwise(path))
    path = [corners[k] for k in np.argsort(np.arctan2(flat[:, 1], flat[:, 0]), kind="stable")]
    return list(itertools.pairwise([*path, path[0]]))


_AXES = (Motion.REVOLUTE, Motion.PRISMATIC)


@dataclass(frozen=True, slots=True)
class SkeletonAxis:
    """Axis of a joint.

    Attributes:
        motion: "revolute" for rotation about the axis, "prismatic" for translation along it.
        direction: column of the axis in `directions`.
    """

    motion: Literal["revolute", "prismatic"]
    direction: int


@dataclass(frozen=True, slots=True)
class SkeletonJoint:
    """Joint or constraint between two links.

    Attributes:
        name: name of the joint.
        kind: type of the joint, in lower case.
        cut: whether the joint closes a loop.
        links: indices of the links of frame_a and frame_b, 0 for the base.
        points: columns in `points` of the origins of frame_a and frame_b. The origins coincide,
            except for joints with translations or an offset, and cut joints of an open loop.
        axes: axes of its revolute and prismatic motions; empty for a joint without fixed axes.
    """

    name: str
    kind: str
    cut: bool
    links: tuple[int, int]
    points: tuple[int, int]
    axes: tuple[SkeletonAxis, ...]


@dataclass(frozen=True, slots=True)
class SkeletonLink:
    """Rigid link, or the base.

    Attributes:
        number: index of the link, 0 for the base.
        bodies: names of the bodies of the link.
        segments: pairs of columns in `points`: a line between joints, a polygon through three or
            more joints, lines to frames and force elements. A link with a single point has a line
            to its farthest frame or to its centre of mass. Empty for the base.
        mass_centre: column in `points` of the centre of mass; None for a massless link or base.
    """

    number: int
    bodies: tuple[str, ...]
    segments: tuple[tuple[int, int], ...]
    mass_centre: int | None


@dataclass(frozen=True, slots=True)
class SkeletonForce:
    """Force element between two points.

    Attributes:
        name: name of the element.
        kind: type of the element, in lower case.
        shape: shape of the drawing, such as "coil" or "bar".
        links: indices of the links of its two ends, 0 for the base.
        points: columns in `points` of its two ends.
    """

    name: str
    kind: str
    shape: str
    links: tuple[int, int]
    points: tuple[int, int]


@dataclass(frozen=True, slots=True)
class SkeletonFrame:
    """Frame to draw: a named frame or the terminal frame.

    Attributes:
        name: name of the frame.
        link: index of its link, 0 for the base.
        origin: column in `points` of its origin.
        directions: columns in `directions` of its x, y and z axes.
    """

    name: str
    link: int
    origin: int
    directions: tuple[int, int, int]


@dataclass(frozen=True, slots=True, eq=False)
class Skeleton:
    """Geometry for drawing a mechanism, without colours and sizes.

    Attributes:
        joints: joints in the order of the description.
        links: base, then links of the tree.
        forces: springs, dampers and other elements between two points.
        frames: named frames and the terminal frame.
        function: `skeleton(q) -> points (3, n), directions (3, m)` in the base frame; points in m,
            directions of unit length. p is a second input if the system has parameters.
    """

    joints: tuple[SkeletonJoint, ...]
    links: tuple[SkeletonLink, ...]
    forces: tuple[SkeletonForce, ...]
    frames: tuple[SkeletonFrame, ...]
    function: Function


def skeleton(system: System) -> Skeleton:
    """Return the points and axes of all joints and the lines of all links, for drawing.

    Args:
        system: open or closed mechanism.

    Returns:
        skeleton with the Function that computes its points and directions at positions q.

    Raises:
        ModelError: `system` is not a System.
    """
    require_system(system)
    answer: Skeleton = system.cached("skeleton", lambda: _built(system))
    return answer


@dataclass(slots=True)
class _Marks:
    """Points and directions fixed to links, collected in the order of their columns.

    Attributes:
        system: mechanism.
        points: (link index, pose) of each point, -1 for the base.
        directions: (link index, axis) of each direction, in the frame of the link.
    """

    system: System
    points: list[Frame] = field(default_factory=list)
    directions: list[tuple[int, SX]] = field(default_factory=list)

    def point(self, frame: Frame) -> int:
        """Add the origin of a frame and return its index."""
        self.points.append(frame)
        return len(self.points) - 1

    def direction(self, link: int, axis: SX) -> int:
        """Add a direction (3, 1) in the frame of a link and return its index."""
        self.directions.append((link, axis))
        return len(self.directions) - 1

    def local(self, numbers: Sequence[int]) -> NDArray[np.float64]:
        """Return the coordinates (k, 3) of points, by column, in the frames of their links [m]."""
        return self.places([self.points[k][1] for k in numbers])

    def places(self, poses: Sequence[Pose]) -> NDArray[np.float64]:
        """Return the numeric origins (k, 3) of poses [m].

        Parameters have their defaults, or 1 without default.
        """
        p = [1.0 if np.isnan(value) else value for value in self.system.parameter_values(needed=())]
        origins = casadi.horzcat(*(pose.p for pose in poses))
        return np.array(Function("places", [self.system.p], [origins])(p)).T


def _built(system: System) -> Skeleton:
    """Return the skeleton of a system: points, links, joints, frames and forces."""
    marks = _Marks(system)
    joints = tuple(_joint(marks, row) for row in system.joints)
    forces = tuple(
        SkeletonForce(
            part.name,
            type(part.element).__name__.lower(),
            part.element.shape,
            (a[0] + 1, b[0] + 1),
            (marks.point(a), marks.point(b)),
        )
        for part in system.parts
        if part.element.shape
        for a, b in itertools.pairwise(part.frames)
    )
    frames = tuple(_frame(marks, name) for name in _shown_frames(system))
    links = tuple(_link(marks, number, joints) for number in range(len(system.links) + 1))
    return Skeleton(joints, links, forces, frames, _function(system, marks))


def _joint(marks: _Marks, row: JointRow) -> SkeletonJoint:
    """Return name, end points and axes of a joint for drawing.

    `row` is the row of the joint in `system.joints`. Its points and directions are added to
    `marks`.
    """
    (a, pose_a), (b, pose_b) = row.frame_a, row.frame_b
    return SkeletonJoint(
        name=row.name,
        kind=row.kind,
        cut=row.cut,
        links=(a + 1, b + 1),
        points=(marks.point((a, pose_a)), marks.point((b, pose_b))),
        axes=_cut_axes(marks, row) if row.cut else _tree_axes(marks, row.name),
    )


def _tree_axes(marks: _Marks, name: str) -> tuple[SkeletonAxis, ...]:
    """Return the axes of the tree joint `name`: z axes of links with revolute or prismatic motion.

    The directions are added to `marks`.
    """
    system = marks.system
    moved = (
        (j, link.motion)
        for j, link in enumerate(system.tree.links)
        if system.coordinates[link.q.start].joint == name and link.motion in _AXES
    )
    return tuple(_axis(marks, j, motion, SX([0, 0, 1])) for j, motion in moved)


def _cut_axes(marks: _Marks, row: JointRow) -> tuple[SkeletonAxis, ...]:
    """Return the axes of a cut joint: the first is fixed in frame_a, further ones in frame_b.

    `row` is the row of the joint in `system.joints`. The directions are added to `marks`.
    """
    cut = next(cut for cut in marks.system.cuts if cut.edge.joint.name == row.name)
    frames = (row.frame_a, row.frame_b)
    found = []
    for k, freedom in enumerate(cut.edge.joint.freedoms):
        if freedom.motion in _AXES:
            link, pose = frames[min(k, 1)]
            axis = casadi.mtimes(pose.R, SX(casadi.DM(freedom.axis)))
            found.append(_axis(marks, link, freedom.motion, axis))
    return tuple(found)


def _axis(marks: _Marks, link: int, motion: Motion, axis: SX) -> SkeletonAxis:
    """Return the drawn axis of a freedom with the type `motion`, revolute or prismatic.

    `axis` (3, 1) is its direction in the frame of the link with index `link`; it is added to
    `marks`.
    """
    kind: Literal["revolute", "prismatic"]
    kind = "revolute" if motion is Motion.REVOLUTE else "prismatic"
    return SkeletonAxis(kind, marks.direction(link, axis))


def _shown_frames(system: System) -> list[str | int]:
    """Return the names of the frames that are drawn: named frames and the terminal frame."""
    outer = [OUTER_WORLD] if OUTER_WORLD in system.frames else []
    return list(dict.fromkeys([*outer, *system.named_frames, terminal_frame(system)]))


def _frame(marks: _Marks, name: str | int) -> SkeletonFrame:
    """Return origin and axes of the frame `name` for drawing; they are added to `marks`."""
    link, pose = marks.system.frame(name)
    x, y, z = (marks.direction(link, pose.R[:, k]) for k in range(3))
    label = f"link {name}" if isinstance(name, int) else name
    return SkeletonFrame(label, link + 1, marks.point((link, pose)), (x, y, z))


def _link(marks: _Marks, number: int, joints: Sequence[SkeletonJoint]) -> SkeletonLink:
    """Return bodies and line segments of the link with index `number` (0: base) for drawing.

    `joints` are all joints of the skeleton. Further points of the link are added to `marks`.
    """
    bodies = tuple(row.name for row in marks.system.bodies if row.link == number)
    if number == 0:
        return SkeletonLink(0, bodies, (), None)
    every = [
        (joint.kind, point)
        for joint in joints
        for link, point in zip(joint.links, joint.points, strict=True)
        if link == number
    ]
    joined = [point for kind, point in every if kind != "free"]
    taken = {point for _, point in every}
    others = [
        k for k, (link, _) in enumerate(marks.points) if link == number - 1 and k not in taken
    ]
    centre = _mass_centre(marks, number)
    segments = _segments(marks, joined, others)
    if not segments and joined:
        far = _farthest_frame(marks, number, joined[0], centre)
        segments = () if far is None else _segments(marks, [*joined, *others], [far])
    if not segments and centre is not None:
        segments = _segments(marks, [*joined, *others], [centre])
    return SkeletonLink(number, bodies, segments, centre)


def _segments(
    marks: _Marks, joined: Sequence[int], shown: Sequence[int]
) -> tuple[tuple[int, int], ...]:
    """Return line segments between joints and other points of a link, as pairs of columns.

    `joined` and `shown` are the columns of the joints and of the other points in the points of
    `marks`.
    """
    columns = [*joined, *shown]
    if not columns:
        return ()
    lines = link_outline(marks.local(columns), len(joined))
    return tuple((columns[a], columns[b]) for a, b in lines)


def _farthest_frame(marks: _Marks, number: int, joint: int, centre: int | None) -> int | None:
    """Return the column of the frame of a link, such as a foot, that is farthest from its joint.

    None if the link has no frame, or if all its frames coincide with the joint.

    Args:
        marks: collector to which the origin of the frame is added.
        number: index of the link.
        joint: column of the joint in `points`.
        centre: column of the centre of mass; it is returned if the frame coincides with it.
    """
    places = [pose for link, pose in marks.system.frames.values() if link == number - 1]
    if not places:
        return None
    columns = [joint] if centre is None else [joint, centre]
    known = marks.local(columns)
    at = marks.places(places)
    away = np.linalg.norm(at - known[0], axis=1)
    far = int(np.argmax(away))
    same = np.linalg.norm(known - at[far], axis=1) <= _SAME * max(float(np.abs(at).max()), 1.0)
    if same.any():
        return None if same[0] else centre
    return marks.point((number - 1, places[far]))


def _mass_centre(marks: _Marks, number: int) -> int | None:
    """Return the column of the centre of mass of link `number`, added to the points of `marks`.

    None for a link of zero or unknown mass.
    """
    inertia, system = marks.system.tree.links[number - 1].inertia, marks.system
    known = casadi.vertcat(inertia.m, inertia.ms)
    at = Function("centre", [system.p], [known])(system.parameter_values(needed=()))
    if not at.is_regular() or not float(at[0]) > 0:
        return None
    return marks.point((number - 1, Pose.translation(inertia.ms / inertia.m)))


def _function(system: System, marks: _Marks) -> Function:
    """Return the function of q that computes all points and directions collected in `marks`."""

    def build() -> tuple[Named, Named]:
        q = SX.sym("q", system.nq)
        poses = base_poses(system.tree, link_poses(system.tree, normalised(system.tree, q)))
        poses.append(Pose.identity())  # the base is link -1
        points = [poses[j].p + casadi.mtimes(poses[j].R, at.p) for j, at in marks.points]
        directions = [casadi.mtimes(poses[j].R, axis) for j, axis in marks.directions]
        outputs = [
            (name, casadi.horzcat(SX(3, 0), *columns))
            for name, columns in (("points", points), ("directions", directions))
        ]
        return [("q", q)], outputs

    return model_function(system, ("skeleton",), build)
