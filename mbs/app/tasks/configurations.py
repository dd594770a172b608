"""Inverse kinematics: all configurations in which a frame has a given pose, as a table."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.expressions import Scalar, number
from mbs.formats.rotations import axis_rotation
from mbs.loops.pose import goal
from mbs.models import inverse_geometry, transform
from mbs.models.catalogue.configurations import SIX, held_at, moving_joints, surplus_joints
from mbs.models.geometry import terminal_frame
from mbs.models.inverse_geometry import Solution, Solutions
from mbs.models.inverse_geometry.solutions import CoordinateLimits, bounds
from mbs.text import quoted

# Poses as text: elements of a matrix, or a position and three angles.


Array = NDArray[np.float64]

_LONGEST = 2000
_UPRIGHT = 1e-9
"""Cosine between the x axis and the horizontal plane below which roll and yaw are the same angle.
Rounding errors of a pose, 1e-16, rotate them by 1e-16 divided by this cosine."""
_FORMS = (
    "write x y z roll pitch yaw, or the 12 or 16 numbers of the matrix row by row, with blanks or"
    " commas between them"
)


def pose_of(
    system: System,
    q: Sequence[float] | Mapping[str, float] | None,
    frame: str | int | None = None,
    parameters: Mapping[str, float] | None = None,
) -> Array:
    """Return the pose of a frame relative to the base, (4, 4) [m].

    Args:
        system: the mechanism.
        q: positions, (nq,) or by name [rad or m].
        frame: body, named frame or number of a link; None for the terminal frame.
        parameters: values of symbols. Default: their default values.

    Raises:
        ModelError: the frame or a coordinate is unknown, or a symbol has no value.
    """
    function = transform(system, terminal_frame(system) if frame is None else frame)
    p = [system.parameter_values(parameters)] if system.parameters else []
    return np.array(function(system.position(q), *p), dtype=float)


def pose_from(xyz: Sequence[Scalar], rpy: Sequence[Scalar]) -> Array:
    """Return the pose with a position and rotations about the fixed axes x, then y, then z.

    Args:
        xyz: (3,) position of the origin [m].
        rpy: (3,) roll, pitch and yaw [rad].

    Returns:
        Homogeneous matrix (4, 4) with R = Rz(yaw) Ry(pitch) Rx(roll).

    Raises:
        ModelError: the lengths are not three, or an element has no value.
    """
    if len(xyz) != 3 or len(rpy) != 3:
        raise ModelError(
            f"a pose has three coordinates and three angles, {len(xyz)} and {len(rpy)} were given;"
            " write x y z roll pitch yaw"
        )
    T = np.eye(4)
    T[:3, 3] = [number(value, "pose") for value in xyz]
    roll, pitch, yaw = (number(value, "pose") for value in rpy)
    T[:3, :3] = axis_rotation(2, yaw) @ axis_rotation(1, pitch) @ axis_rotation(0, roll)
    return T


def rpy_of(T: Array) -> tuple[float, float, float]:
    """Return roll, pitch and yaw [rad] of a pose, with R = Rz(yaw) Ry(pitch) Rx(roll).

    Roll is 0 if the x axis is vertical, where only a combination of roll and yaw is determined.

    Args:
        T: (4, 4) homogeneous matrix.
    """
    R = np.asarray(T, dtype=float)[:3, :3]
    level = math.hypot(R[0, 0], R[1, 0])
    pitch = math.atan2(-R[2, 0], level)
    if level < _UPRIGHT:
        return 0.0, pitch, math.atan2(-R[0, 1], R[1, 1])
    return math.atan2(R[2, 1], R[2, 2]), pitch, math.atan2(R[1, 0], R[0, 0])


def pose_from_text(text: str) -> Array:
    """Read a pose (4, 4) from a text.

    Args:
        text: "x y z roll pitch yaw", or 12 or 16 elements of the matrix row by row. Elements are
            separated by blanks, commas, semicolons or line breaks. Each may be an expression
            without blanks, such as pi/2.

    Raises:
        ModelError: the number of elements is wrong, or an element has no value.
    """
    if len(text) > _LONGEST:
        raise ModelError(f"the text of the pose has {len(text)} characters; {_FORMS}")
    parts = [part for part in re.split(r"[\s,;\[\]]+", text) if part]
    if len(parts) == 6:
        return pose_from(parts[:3], parts[3:])
    if len(parts) not in (12, 16):
        raise ModelError(f"the pose {quoted(text)} has {len(parts)} numbers; {_FORMS}")
    T = np.eye(4)
    T[: len(parts) // 4] = np.array([number(part, "pose") for part in parts]).reshape(-1, 4)
    return T


__all__ = [
    "Configuration",
    "ConfigurationList",
    "Near",
    "configurations",
    "locked_by_default",
    "pose_from",
    "pose_from_text",
    "pose_of",
    "rpy_of",
]

Seed = Sequence[float] | Mapping[str, float] | None
Values = Mapping[str, float] | None


@dataclass(frozen=True, slots=True)
class Configuration:
    """Configuration in which the frame has the pose.

    Attributes:
        q: (nq,) positions [rad or m].
        label: name of the solution branch, such as the sides of shoulder, elbow and wrist.
        residual: largest element of the difference between the pose at q and the target [m or 1].
        sigma: smallest singular value of the Jacobian; zero at a singular configuration.
        multiplicity: number of roots that coincide here; 0 for a point of a self-motion.
        within_limits: whether all joints can be within their limits, after full rotations.
        outside: names of the joints that cannot.
        family: description of the self-motion that it represents; "" for an isolated solution.
        windings: number of configurations within limits that differ from it by full rotations.
    """

    q: tuple[float, ...]
    label: str
    residual: float
    sigma: float
    multiplicity: int
    within_limits: bool
    outside: tuple[str, ...]
    family: str
    windings: int


@dataclass(frozen=True, slots=True)
class Near:
    """Reachable pose that is nearest to the target.

    Attributes:
        q: (nq,) configuration with this pose and closed loops [rad or m].
        distance: distance between the origins of both poses [m].
        angle: angle between the orientations of both poses [rad].
        T: pose, rows of (4, 4).
    """

    q: tuple[float, ...]
    distance: float
    angle: float
    T: tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True)
class ConfigurationList:
    """All configurations in which a frame has a given pose.

    Attributes:
        system: name of the mechanism.
        frame: frame that has the pose.
        T: target pose, rows of (4, 4).
        names: names of the coordinates.
        units: units of the coordinates.
        locked: locked joints and their positions.
        redundant: redundant joints that are sampled, and their numbers of positions.
        method: method that found the configurations.
        reason: reason why there is no configuration; "" if there are any.
        rows: configurations, sorted by distance from the seed.
        nearest: reachable pose nearest to the target, if there is no configuration.
        text: the same as a plain table.
    """

    system: str
    frame: str | int
    T: tuple[tuple[float, ...], ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    locked: tuple[tuple[str, float], ...]
    redundant: tuple[tuple[str, int], ...]
    method: str
    reason: str
    rows: tuple[Configuration, ...]
    nearest: Near | None
    text: str


def locked_by_default(
    system: System, frame: str | int | None = None, seed: Seed = None
) -> dict[str, float]:
    """Return the positions of the joints that are locked by default; empty up to six joints.

    Args:
        system: the mechanism.
        frame: body, named frame or number of a link; None for the terminal frame.
        seed: configuration that gives the positions; None for the assembled configuration.

    Returns:
        Position by joint name [rad or m].
    """
    name = terminal_frame(system) if frame is None else frame
    return held_at(system, surplus_joints(system, name), system.position(seed))


def configurations(
    system: System,
    T: Any,
    frame: str | int | None = None,
    method: str = "auto",
    *,
    seed: Seed = None,
    locked: Mapping[str, float] | None = None,
    redundant: Mapping[str, int] | None = None,
    parameters: Values = None,
) -> ConfigurationList:
    """Find all configurations in which a frame has a given pose, with and without loops.

    Args:
        system: the mechanism.
        T: (4, 4) pose of the frame relative to the base [m].
        frame: body, named frame or number of a link; None for the terminal frame.
        method: method of `mbs.models.inverse_geometry.solve`. The general method requires six
            joints; for other chains "general" uses the search.
        seed: configuration from which distances are measured, and which gives the positions of
            joints outside the chain.
        locked: positions of locked joints, by name. Default: `locked_by_default`, with one joint
            less for each redundant joint.
        redundant: name of a joint to the number of positions that it takes between its limits.
        parameters: values of symbols. Default: their default values.

    Raises:
        ModelError: T is no pose, or a name or method is unknown.
        NoClosedForm: Pieper's or Paul's method does not fit the mechanism.
    """
    name = terminal_frame(system) if frame is None else frame
    many = dict(redundant or {})
    if locked is None:
        held = locked_by_default(system, name, seed)
        for _ in many:  # unlock one joint for each redundant joint
            held.pop(next((joint for joint in held if joint in many), next(iter(held), "")), None)
    else:
        held = dict(locked)
    way = _method(system, name, method, {**held, **many})
    found = inverse_geometry.solve(
        system,
        T,
        name,
        way,
        seed=seed,
        locked=held or None,
        redundant=many or None,
        parameters=parameters,
    )
    limits = bounds(system)
    return ConfigurationList(
        system=system.name,
        frame=name,
        T=_rows_of(np.asarray(T, dtype=float)),
        names=found.names,
        units=tuple(c.unit for c in system.coordinates),
        locked=tuple(held.items()),
        redundant=tuple(many.items()),
        method=found.method,
        reason=found.reason,
        rows=tuple(_row(one, limits) for one in found),
        nearest=None if len(found) else _near(system, found, (name, T), seed, parameters),
        text=str(found),
    )


def _method(system: System, frame: str | int, method: str, held: Mapping[str, float]) -> str:
    """Return the method to use: "search" instead of "general" unless six joints are free.

    `held` are the locked and the redundant joints.
    """
    free = [joint for joint in moving_joints(system, frame) if joint not in held]
    return "search" if method == "general" and free and len(free) != SIX else method


def _row(one: Solution, limits: CoordinateLimits) -> Configuration:
    """Return a solution of the inverse geometric model as a row; `limits` are the joint limits."""
    return Configuration(
        q=_tuple(one.q),
        label=one.branch,
        residual=float(one.residual),
        sigma=float(one.sigma_min),
        multiplicity=one.multiplicity,
        within_limits=one.within_limits,
        outside=() if one.within_limits else tuple(limits.outside(one.q)),
        family=str(one.family) if one.family else "",
        windings=len(one.windings),
    )


def _near(
    system: System, found: Solutions, wanted: Any, seed: Seed, parameters: Values
) -> Near | None:
    """Return the nearest reachable pose; for loops, a local minimum found from the seed.

    None if no such pose was found. `wanted` is (frame, target pose).
    """
    near = found.nearest
    if near is not None and np.all(np.isfinite(near.q)):
        return Near(_tuple(near.q), float(near.distance), float(near.angle), _rows_of(near.T))
    if not system.is_closed:
        return None
    frame, T = wanted
    aim = goal(system, frame, T, None, parameters)
    best = aim.approach(np.array(system.position(seed)))
    if not best.is_closed:
        return None
    distance, angle = aim.gap(best.q)
    q = _tuple(best.q)
    return Near(q, distance, angle, _rows_of(pose_of(system, q, frame, parameters)))


def _rows_of(T: Array) -> tuple[tuple[float, ...], ...]:
    """Return a matrix as tuples of rows."""
    return tuple(tuple(float(x) for x in row) for row in T)


def _tuple(q: Array) -> tuple[float, ...]:
    """Return a vector as a tuple of floats."""
    return tuple(float(x) for x in q)
