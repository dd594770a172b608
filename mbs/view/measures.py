"""How large a picture is and where it is seen from: sizes, bounds, ground and directions."""

from __future__ import annotations

from dataclasses import dataclass

import casadi
import numpy as np

from mbs.view.posed import Array, PosedLinks, three
from mbs.view.primitives import Vector

_NICE = (1.0, 2.0, 5.0)


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
class BoundingBall:
    """A ball that holds the mechanism: center and radius [m], in the base frame."""

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
    every = np.vstack([np.zeros((1, 3)), scene.points, solid_points])
    size = float(np.linalg.norm(np.ptp(every, axis=0)))
    lengths = [
        float(np.linalg.norm(scene.points[a] - scene.points[b]))
        for link in scene.parts.links
        for a, b in link.segments
    ]
    lengths = [length for length in lengths if length > 1e-6 * size]
    if size == 0:
        size = 4 * _gyration(scene)
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


def bounds_of(points: Array, margin: float) -> BoundingBall:
    """The ball about a cuboid that holds points (n, 3), a margin wider [m]."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle = three((low + high) / 2)
    reach = float(np.linalg.norm(points - (low + high) / 2, axis=1).max())
    return BoundingBall(middle, reach + margin)


def floor_of(points: Array, up: Array, bounds: BoundingBall, gap: float = 0.0) -> Floor:
    """A ground that is a gap [m] below points (n, 3) and below the base frame."""
    lowest = min(0.0, float((points @ up).min())) - gap
    center = np.array(bounds.center)
    center = center + (lowest - float(center @ up)) * up
    step = _nice(bounds.radius / 5)
    return Floor(three(center), step, 3.2 * bounds.radius)


def _nice(value: float) -> float:
    power = 10.0 ** np.floor(np.log10(value))
    return float(min((n * power for n in (*_NICE, 10.0)), key=lambda n: abs(n - value)))


def views(scene: PosedLinks) -> dict[str, Vector]:
    """Unit vectors from a mechanism towards who looks at it, by the name of the view.

    The front of a mechanism that moves in a plane is the side from which the plane is seen.
    """
    up = scene.up
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
    same = all(abs(float(axis @ axes[0])) > 1 - 1e-6 for axis in axes)
    return np.array(axes[0]) if same else None


def _unit(vector: Array) -> Array:
    return np.array(vector / np.linalg.norm(vector))
