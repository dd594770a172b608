"""Mechanism at a configuration: poses of its links, and sizes, bounds and views of its picture."""

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
from mbs.recursions.link_motions import base_poses, link_poses
from mbs.view.primitives import Rows, Vector

Array = NDArray[np.float64]
Values = Mapping[str, float] | Sequence[float] | None


@dataclass(frozen=True, slots=True, eq=False)
class PosedLinks:
    """System with the poses of its links at a configuration.

    Attributes:
        system: mechanism.
        parameters: value of every symbol, NaN for a symbol without value outside the geometry.
        parts: skeleton of the mechanism.
        points: points (n, 3) of the skeleton in the base frame [m].
        directions: unit directions (m, 3) of the skeleton in the base frame.
        poses: poses (links + 1, 3, 4) [R p] of the base and every link in the base frame.
        up: unit vector against gravity in the base frame. Without gravity, z of the outer world.
    """

    system: System
    parameters: Mapping[str, float]
    parts: Skeleton
    points: Array
    directions: Array
    poses: Array
    up: Array

    def local(self, link: int, point: Array) -> Vector:
        """Return a point of the base frame in the frame of a link.

        Args:
            link: number of the link, 0 for the base.
            point: (3,) point in the base frame [m].
        """
        R, p = self.poses[link, :, :3], self.poses[link, :, 3]
        return three(R.T @ (point - p))

    def local_direction(self, link: int, direction: Array) -> Vector:
        """Return a direction of the base frame in the frame of a link.

        Args:
            link: number of the link, 0 for the base.
            direction: (3,) direction in the base frame.
        """
        return three(self.poses[link, :, :3].T @ direction)

    def local_pose(self, link: int, R: Array, p: Array) -> Rows:
        """Transform a pose from the base frame to the frame of a link.

        Args:
            link: number of the link, 0 for the base.
            R: rotation matrix (3, 3) in the base frame.
            p: origin (3,) in the base frame [m].

        Returns:
            The 12 numbers of the rows of [R p] in the link frame.
        """
        R_link = self.poses[link, :, :3].T @ R
        place = np.array(self.local(link, p)).reshape(3, 1)
        return rows(np.hstack([R_link, place]))


def three(values: Array) -> Vector:
    """Convert a vector (3,) to a tuple of floats."""
    x, y, z = (float(value) for value in values)
    return x, y, z


def rows(pose: Array) -> Rows:
    """Convert a pose [R p] (3, 4) to a tuple of floats by rows."""
    return tuple(float(value) for value in np.ravel(pose))


def pose_links(
    system: System, q: Sequence[float], parameters: Mapping[str, float] | None
) -> PosedLinks:
    """Return the poses of the links and the points of the skeleton at positions q.

    Args:
        system: mechanism, open or closed. Every symbol in its geometry has a value.
        q: positions (nq,) [rad or m].
        parameters: values of symbols. Other symbols have their default values.

    Raises:
        ModelError: a symbol has no value, or a position is not a number.
    """
    p = system.parameter_values(parameters, picture_symbols(system))
    parts = skeleton(system)
    given = (list(q), _without_nan(p)) if system.parameters else (list(q),)
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
    """Return the names of the symbols on which poses of links, joints and frames depend.

    The result is cached in the system.

    Args:
        system: mechanism, open or closed.
    """

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
    """Return the direction against gravity, or z if gravity is zero or its symbol has no value.

    Args:
        gravity: acceleration (3,) in the base frame [m/s^2].
        z: z axis (3,) of the outer world in the base frame.
    """
    size = float(np.linalg.norm(gravity))
    return -gravity / size if size > 0 else z


def pose_rows(system: System, q: Array, p: Sequence[float]) -> Array:
    """Return the poses of the base and every link at many configurations.

    Args:
        system: mechanism.
        q: configurations (nq, n), one per column [rad or m].
        p: values of all parameters of the system; NaN for parameters that no pose depends on.

    Returns:
        Poses (12 (links + 1), n). Each pose has 12 numbers, the rows of [R p] in the base frame.
    """
    function = _pose_function(system)
    if not system.parameters:
        return np.array(function(DM(q)))
    every = np.repeat(np.array(_without_nan(p)).reshape(-1, 1), q.shape[1], axis=1)
    return np.array(function(DM(q), DM(every)))


def _without_nan(p: Sequence[float]) -> list[float]:
    """Replace NaN, the value of symbols on which no pose depends, by 0."""
    return [0.0 if np.isnan(value) else value for value in p]


def _pose_function(system: System) -> Function:
    """Return the compiled Function of the poses (12 (links + 1), 1) of base and links at q."""

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
    """Return positions (nq,) [rad or m] from a sequence, or from a dict by name.

    Args:
        system: mechanism, open or closed.
        q: positions (nq,), or a dict of some positions by name. Positions that are not named, and
            None, mean the assembled configuration.

    Raises:
        ModelError: a name is unknown, or the number of positions is wrong.
    """
    return system.position(q)


# Sizes, bounds, ground and view directions of a picture.


_NICE = (1.0, 2.0, 5.0)
"""Allowed cell widths of the ground grid, times powers of ten: easy to count."""
SAME_POINT = 1e-6
"""Distance below which two points coincide in a picture, relative to the size of the mechanism.
Rounding errors are smaller, and a pixel is 1000 times larger."""


@dataclass(frozen=True, slots=True)
class Measures:
    """Sizes of shapes without own dimensions [m].

    Attributes:
        size: size of the mechanism.
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
    """Sphere that contains the mechanism.

    Attributes:
        center: centre in the base frame [m].
        radius: radius [m].
    """

    center: Vector
    radius: float


@dataclass(frozen=True, slots=True)
class Floor:
    """Ground grid.

    Attributes:
        center: centre in the base frame [m].
        step: width of a cell [m].
        reach: half of the extent of the grid [m].
    """

    center: Vector
    step: float
    reach: float


def measures(scene: PosedLinks, solid_points: Array) -> Measures:
    """Return sizes of shapes from the extent of a mechanism and the lengths of its links.

    Args:
        scene: posed links.
        solid_points: corners (k, 3) of solids in the base frame [m].
    """
    world = [frame.origin for frame in scene.parts.frames if frame.name == OUTER_WORLD]
    own = np.delete(scene.points, world, axis=0)  # a distant mount has no effect
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
    # fractions of the size and link length: joints are visible and leave most of a link free;
    # links are thinner than joints
    joint = min(0.028 * size, 0.2 * float(np.median(lengths))) if lengths else 0.028 * size
    return Measures(size, joint, 0.62 * joint, max(3.6 * joint, 0.07 * size))


def _gyration(scene: PosedLinks) -> float:
    """Return the largest radius of gyration of the links [m], or 1 m without inertia."""
    system = scene.system
    found = 0.0
    for link in system.tree.links:
        both = casadi.vertcat(casadi.trace(link.inertia.J), link.inertia.m)
        J, m = np.array(casadi.Function("J", [system.p], [both])(system.parameter_values())).ravel()
        if m > 0:
            found = max(found, float(np.sqrt(max(J, 0.0) / (2 * m))))
    return found or 1.0


def bounds_of(points: Array, margin: float) -> BoundingSphere:
    """Return a sphere, about the middle of the bounding box, that contains all points.

    Args:
        points: points (n, 3) in the base frame [m].
        margin: additional radius [m].
    """
    low, high = points.min(axis=0), points.max(axis=0)
    middle = three((low + high) / 2)
    reach = float(np.linalg.norm(points - (low + high) / 2, axis=1).max())
    return BoundingSphere(middle, reach + margin)


def floor_of(points: Array, up: Array, bounds: BoundingSphere, gap: float = 0.0) -> Floor:
    """Return the ground grid below a mechanism.

    Args:
        points: points (n, 3) of the mechanism in the base frame [m].
        up: unit vector against gravity in the base frame.
        bounds: bounding sphere, which gives the extent of the grid.
        gap: distance of the ground below the lowest point and the origin of the base frame [m].
    """
    lowest = min(0.0, float((points @ up).min())) - gap
    center = np.array(bounds.center)
    center = center + (lowest - float(center @ up)) * up
    step = _grid_step(bounds.radius / 5)
    # so large that its border fades out in the distance
    return Floor(three(center), step, 3.2 * bounds.radius)


def _grid_step(value: float) -> float:
    """Return the number nearest to a positive value among 1, 2 and 5 times powers of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(min((n * power for n in (*_NICE, 10.0)), key=lambda n: abs(n - value)))


def views(scene: PosedLinks) -> dict[str, Vector]:
    """Return unit vectors (3,) towards the viewer in the base frame, by name of the view.

    The names are iso, front, side and top. The front view of a mechanism that moves in a vertical
    plane is along the normal of the plane.

    Args:
        scene: posed links.
    """
    up = scene.up
    # limits of cosines of nearly equal directions; weights of front, right and up: a vertical
    # plane is seen almost from its front, a level mechanism from above, others from a corner
    x = np.eye(3)[0]
    right = _unit(np.cross(up, [0.0, 0.0, 1.0]) if abs(up[0]) > 0.9 else x - float(x @ up) * up)
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
    """Whether all points are near a level plane, and all revolute axes are parallel."""
    # height relative to the extent, for links of some thickness above each other
    heights = scene.points @ scene.up
    spread = float(np.linalg.norm(np.ptp(scene.points, axis=0)))
    return bool(np.ptp(heights) < 0.12 * spread) and plane_normal(scene) is not None


def plane_normal(scene: PosedLinks) -> Array | None:
    """Return the common direction (3,) of all revolute axes in the base frame.

    None if the axes differ, or without revolute joints, or with a free or spherical joint.

    Args:
        scene: posed links.
    """
    axes = [
        scene.directions[axis.direction]
        for joint in scene.parts.joints
        for axis in joint.axes
        if axis.motion == "revolute"
    ]
    kinds = {joint.kind for joint in scene.parts.joints}
    if not axes or kinds & {"free", "spherical"}:
        return None
    # parallel within about 0.001 rad, which is not visible in a drawing
    same = all(abs(float(axis @ axes[0])) > 1 - 1e-6 for axis in axes)
    return np.array(axes[0]) if same else None


def _unit(vector: Array) -> Array:
    """Return a vector divided by its length."""
    return np.array(vector / np.linalg.norm(vector))
