"""A mechanism at one configuration: where its links are, and how large the picture is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function
from mbs.assembly.tree import normalised
from mbs.components.description import OUTER_WORLD
from mbs.models.skeleton import Skeleton, skeleton
from mbs.recursions.poses import base_poses, link_poses
from mbs.view.primitives import Rows, Vector

Array = NDArray[np.float64]
Values = Mapping[str, float] | Sequence[float] | None


@dataclass(frozen=True, slots=True, eq=False)
class PosedLinks:
    """A system whose links have poses.

    Attributes:
        system: the mechanism.
        parameters: value of every symbol; NaN if the picture needs none.
        parts: its skeleton.
        points: (n, 3) of the skeleton, in the base frame [m].
        directions: (m, 3) of the skeleton, in the base frame.
        poses: (links + 1, 3, 4) R|p of the base and every link.
        up: unit vector against gravity; z of the outer world if there is no gravity.
    """

    system: System
    parameters: Mapping[str, float]
    parts: Skeleton
    points: Array
    directions: Array
    poses: Array
    up: Array

    def local(self, link: int, point: Array) -> Vector:
        """A point of the base frame in the frame of a link."""
        R, p = self.poses[link, :, :3], self.poses[link, :, 3]
        return three(R.T @ (point - p))

    def local_direction(self, link: int, direction: Array) -> Vector:
        """A direction of the base frame in the frame of a link."""
        return three(self.poses[link, :, :3].T @ direction)

    def local_pose(self, link: int, R: Array, p: Array) -> Rows:
        """The pose (R, p) in the base frame, seen from a link."""
        R_link = self.poses[link, :, :3].T @ R
        place = np.array(self.local(link, p)).reshape(3, 1)
        return rows(np.hstack([R_link, place]))


def three(values: Array) -> Vector:
    """The elements of a vector."""
    x, y, z = (float(value) for value in values)
    return x, y, z


def rows(pose: Array) -> Rows:
    """The elements of R|p, row by row."""
    return tuple(float(value) for value in np.ravel(pose))


def pose_links(
    system: System, q: Sequence[float], parameters: Mapping[str, float] | None
) -> PosedLinks:
    """The links and the skeleton at positions q.

    Args:
        system: open or closed; every symbol in its geometry has a value.
        q: (nq,) [rad or m].
        parameters: values of symbols, the others at their defaults.

    Raises:
        ModelError: a symbol has no value, or a place is no number.
    """
    p = system.parameter_values(parameters, picture_symbols(system))
    parts = skeleton(system)
    given = (list(q), _placed(p)) if system.parameters else (list(q),)
    points, directions = (np.array(m).T.reshape(-1, 3) for m in parts.function(*given))
    poses = pose_rows(system, np.array(given[0]).reshape(-1, 1), p)[:, 0]
    gravity = Function("gravity", [system.p], [casadi.densify(system.tree.gravity)])
    names = [parameter.name for parameter in system.parameters]
    world = [directions[f.directions[2]] for f in parts.frames if f.name == OUTER_WORLD]
    return PosedLinks(
        system,
        dict(zip(names, p, strict=True)),
        parts,
        points,
        directions,
        poses.reshape(-1, 3, 4),
        _up(np.array(gravity(p)).ravel(), world[0] if world else np.array([0.0, 0.0, 1.0])),
    )


def picture_symbols(system: System) -> frozenset[str]:
    """Names of the symbols on which the places of links, joints and frames depend."""

    def found() -> frozenset[str]:
        if not system.parameters:
            return frozenset()
        names = [parameter.name for parameter in system.parameters]
        columns: set[int] = set()
        for function in (_pose_function(system), skeleton(system).function):
            for output in range(function.n_out()):
                pattern = function.jac_sparsity(output, function.n_in() - 1)
                columns.update(pattern.get_triplet()[1])
        return frozenset(names[k] for k in columns)

    answer: frozenset[str] = system.cached("picture symbols", found)
    return answer


def _up(gravity: Array, z: Array) -> Array:
    """The direction against gravity; z without gravity, or if its symbol has no value.

    Args:
        gravity: acceleration in the base frame [m/s^2].
        z: axis of the outer world in the base frame.
    """
    size = float(np.linalg.norm(gravity))
    return -gravity / size if size > 0 else z


def pose_rows(system: System, q: Array, p: Sequence[float]) -> Array:
    """(12 (links + 1), n) rows of R|p of the base and every link at the columns of q (nq, n).

    Raises:
        ModelError: a symbol has no value, or a place is no number.
    """
    function = _pose_function(system)
    if not system.parameters:
        return np.array(function(DM(q)))
    every = np.repeat(np.array(_placed(p)).reshape(-1, 1), q.shape[1], axis=1)
    return np.array(function(DM(q), DM(every)))


def _placed(p: Sequence[float]) -> list[float]:
    """The parameters with a number for each symbol without a value: no place depends on it."""
    return [0.0 if np.isnan(value) else value for value in p]


def _pose_function(system: System) -> Function:
    def build() -> tuple[Named, Named]:
        q = SX.sym("q", system.nq)
        chain = link_poses(system.tree, normalised(system.tree, q))
        poses_of_links = [
            casadi.vec(casadi.horzcat(pose.R, pose.p).T) for pose in base_poses(system.tree, chain)
        ]
        base = SX([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0])
        return [("q", q)], [("poses", casadi.vertcat(base, *poses_of_links))]

    return model_function(system, ("link_poses",), build)


def position_of(system: System, q: Values) -> list[float]:
    """(nq,) positions from a sequence, or from names, the others as in the assembled configuration.

    Raises:
        ModelError: a name is unknown, or the numbers do not fit.
    """
    values = system.position(q)
    return values


# How large a picture is and where it is seen from: sizes, bounds, ground and directions.


_NICE = (1.0, 2.0, 5.0)
"""Widths of cells that people count with, times powers of ten."""
SAME_POINT = 1e-6
"""Distance, in parts of the size of a mechanism, below which two points are one in a picture:
rounding is less, and a pixel a thousand times more."""


@dataclass(frozen=True, slots=True)
class Measures:
    """Sizes of what has none of its own [m].

    Attributes:
        size: of the mechanism.
        joint: radius of a revolute joint.
        bar: radius of a link.
        frame: length of the axes of a frame.
    """

    size: float
    joint: float
    bar: float
    frame: float


@dataclass(frozen=True, slots=True)
class BoundingSphere:
    """A sphere that contains the mechanism: center and radius [m], in the base frame."""

    center: Vector
    radius: float


@dataclass(frozen=True, slots=True)
class Floor:
    """The grid of the ground: its center, the width of a cell and how far it reaches [m]."""

    center: Vector
    step: float
    reach: float


def measures(scene: PosedLinks, solid_points: Array) -> Measures:
    """Sizes from the extent of a mechanism and from how long its links are.

    Args:
        scene: where it is.
        solid_points: (k, 3) corners of solids, in the base frame [m].
    """
    world = [frame.origin for frame in scene.parts.frames if frame.name == OUTER_WORLD]
    own = np.delete(scene.points, world, axis=0)  # a mount far away leaves the sizes as they are
    every = np.vstack([np.zeros((1, 3)), own, solid_points])
    size = float(np.linalg.norm(np.ptp(every, axis=0)))
    lengths = [
        float(np.linalg.norm(scene.points[a] - scene.points[b]))
        for link in scene.parts.links
        for a, b in link.segments
    ]
    lengths = [length for length in lengths if length > SAME_POINT * size]
    if size == 0:
        size = 4 * _gyration(scene)
    # joints are seen at any size, and leave most of a usual link free; links are thinner than
    # joints
    joint = min(0.028 * size, 0.2 * float(np.median(lengths))) if lengths else 0.028 * size
    return Measures(size, joint, 0.62 * joint, max(3.6 * joint, 0.07 * size))


def _gyration(scene: PosedLinks) -> float:
    """A length from the inertia of the bodies; 1 m where they have none."""
    system = scene.system
    found = 0.0
    for link in system.tree.links:
        both = casadi.vertcat(casadi.trace(link.inertia.J), link.inertia.m)
        J, m = np.array(casadi.Function("J", [system.p], [both])(system.parameter_values())).ravel()
        if m > 0:
            found = max(found, float(np.sqrt(max(J, 0.0) / (2 * m))))
    return found or 1.0


def bounds_of(points: Array, margin: float) -> BoundingSphere:
    """The sphere about a cuboid that contains points (n, 3), a margin wider [m]."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle = three((low + high) / 2)
    reach = float(np.linalg.norm(points - (low + high) / 2, axis=1).max())
    return BoundingSphere(middle, reach + margin)


def floor_of(points: Array, up: Array, bounds: BoundingSphere, gap: float = 0.0) -> Floor:
    """A ground that is a gap [m] below points (n, 3) and below the base frame."""
    lowest = min(0.0, float((points @ up).min())) - gap
    center = np.array(bounds.center)
    center = center + (lowest - float(center @ up)) * up
    step = _nice(bounds.radius / 5)
    # so far that its end fades out behind the mechanism
    return Floor(three(center), step, 3.2 * bounds.radius)


def _nice(value: float) -> float:
    power = 10.0 ** np.floor(np.log10(value))
    return float(min((n * power for n in (*_NICE, 10.0)), key=lambda n: abs(n - value)))


def views(scene: PosedLinks) -> dict[str, Vector]:
    """Unit vectors from a mechanism towards who looks at it, by the name of the view.

    The front of a mechanism that moves in a plane is the side from which the plane is seen.
    """
    up = scene.up
    # cosines that say which directions are about the same, and parts of front, right and up that
    # show a plane almost from its front, what lies level from above, and all else from a corner
    right = _unit(np.cross(up, [0.0, 0.0, 1.0]) if abs(up[0]) > 0.9 else _across(up))
    front = np.cross(right, up)
    normal = plane_normal(scene)
    flat = normal is not None and abs(float(normal @ up)) < 0.1
    if flat and normal is not None:
        front = normal if float(normal @ front) > -1e-9 else -normal
        right = np.cross(up, front)
    if flat:
        tilt = front + 0.42 * right + 0.36 * up
    else:
        tilt = front + 0.95 * right + (1.9 if _is_level(scene) else 0.62) * up
    found = {"iso": tilt, "front": front, "side": right, "top": up + 1e-3 * front}
    return {name: three(_unit(value)) for name, value in found.items()}


def _is_level(scene: PosedLinks) -> bool:
    """Whether everything lies near a level plane."""
    # in parts of how far it extends: links of some thickness above each other
    heights = scene.points @ scene.up
    spread = float(np.linalg.norm(np.ptp(scene.points, axis=0)))
    return bool(np.ptp(heights) < 0.12 * spread) and plane_normal(scene) is not None


def _across(up: Array) -> Array:
    """The x axis, made level."""
    x = np.array([1.0, 0.0, 0.0])
    return x - float(x @ up) * up


def plane_normal(scene: PosedLinks) -> Array | None:
    """The common direction of all revolute axes; None where they differ, or where there is none."""
    axes = [
        scene.directions[axis.direction]
        for joint in scene.parts.joints
        for axis in joint.axes
        if axis.motion == "revolute"
    ]
    kinds = {joint.kind for joint in scene.parts.joints}
    if not axes or kinds & {"free", "spherical"}:
        return None
    # parallel to a thousandth of a radian, as a drawing shows
    same = all(abs(float(axis @ axes[0])) > 1 - 1e-6 for axis in axes)
    return np.array(axes[0]) if same else None


def _unit(vector: Array) -> Array:
    return np.array(vector / np.linalg.norm(vector))
