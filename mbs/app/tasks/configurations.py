"""Every configuration that takes a frame to a pose, as rows of a table."""

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
from mbs.loops.pose import goal
from mbs.models import inverse_geometry, transform
from mbs.models.catalogue.configurations import SIX, held_at, moving_joints, surplus_joints
from mbs.models.geometry import terminal_frame
from mbs.models.inverse_geometry import Solution, Solutions
from mbs.models.inverse_geometry.solutions import CoordinateLimits, bounds
from mbs.text import quoted

# Poses as people write them: numbers of a matrix, or a place and three angles.


Array = NDArray[np.float64]

_LONGEST = 2000
_UPRIGHT = 1e-9
"""Cosine between the x axis and the ground below which roll and yaw are one angle: rounding of
poses turns them by 1e-16 over it."""
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
    """The pose of a frame seen from the base, (4, 4) [m].

    Args:
        system: the mechanism.
        q: positions, (nq,) or by name [rad or m].
        frame: a body, a named frame, the number of a link, or None for the terminal frame.
        parameters: values of symbols, the others at their defaults.

    Raises:
        ModelError: no such frame or coordinate, or a symbol has no value.
    """
    function = transform(system, terminal_frame(system) if frame is None else frame)
    p = [system.parameter_values(parameters)] if system.parameters else []
    return np.array(function(system.position(q), *p), dtype=float)


def pose_from(xyz: Sequence[Scalar], rpy: Sequence[Scalar]) -> Array:
    """The pose (4, 4) of a place and of turns about the fixed axes x, then y, then z.

    R = Rz(yaw) Ry(pitch) Rx(roll).

    Args:
        xyz: (3,) origin [m].
        rpy: (3,) roll, pitch and yaw [rad].

    Raises:
        ModelError: there are not three of each, or one has no value.
    """
    if len(xyz) != 3 or len(rpy) != 3:
        raise ModelError(
            f"a pose has three coordinates and three angles, {len(xyz)} and {len(rpy)} were given;"
            " write x y z roll pitch yaw"
        )
    T = np.eye(4)
    T[:3, 3] = [number(value, "pose") for value in xyz]
    roll, pitch, yaw = (number(value, "pose") for value in rpy)
    T[:3, :3] = _turn(2, yaw) @ _turn(1, pitch) @ _turn(0, roll)
    return T


def rpy_of(T: Array) -> tuple[float, float, float]:
    """Roll, pitch and yaw [rad] of a pose (4, 4); roll is 0 where the x axis stands upright."""
    R = np.asarray(T, dtype=float)[:3, :3]
    level = math.hypot(R[0, 0], R[1, 0])
    pitch = math.atan2(-R[2, 0], level)
    if level < _UPRIGHT:
        return 0.0, pitch, math.atan2(-R[0, 1], R[1, 1])
    return math.atan2(R[2, 1], R[2, 2]), pitch, math.atan2(R[1, 0], R[0, 0])


def pose_from_text(text: str) -> Array:
    """The pose (4, 4) that a text writes.

    Args:
        text: "x y z roll pitch yaw", or 12 or 16 numbers of the matrix row by row, with blanks,
            commas, semicolons or new lines between them; each may be an expression without
            blanks, such as pi/2.

    Raises:
        ModelError: there are not as many numbers, or one has no value.
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


def _turn(axis: int, angle: float) -> Array:
    k, h = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[k, k] = R[h, h] = math.cos(angle)
    R[h, k] = math.sin(angle)
    R[k, h] = -R[h, k]
    return R


__all__ = [
    "METHODS",
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

METHODS = ("auto", "pieper", "paul", "general", "search")
"""Ways to solve the inverse geometric model."""


@dataclass(frozen=True, slots=True)
class Configuration:
    """One configuration that takes the frame to the pose.

    Attributes:
        q: (nq) positions [rad or m].
        label: what tells it from the others, such as the side of shoulder, elbow and wrist.
        residual: largest element of the pose at q less the wanted one [m or 1].
        sigma: smallest singular value of the Jacobian; zero at a singular configuration.
        multiplicity: how many roots meet in it; 0 where it is one of a self-motion.
        within_limits: whether whole turns bring every joint within its limits.
        outside: names of the joints that none brings within.
        family: the self-motion that it stands for, in words; "" where there is none.
        windings: how many configurations within limits differ from it by whole turns.
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
    """The reachable pose that is nearest to the wanted one.

    Attributes:
        q: (nq) a whole configuration that has it, loops closed [rad or m].
        distance: between the origins of both poses [m].
        angle: between their orientations [rad].
        T: the pose, rows of (4, 4).
    """

    q: tuple[float, ...]
    distance: float
    angle: float
    T: tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True)
class ConfigurationList:
    """Every configuration that takes a frame to a pose.

    Attributes:
        system: name of the mechanism.
        frame: that was taken there.
        T: the target pose, rows of (4, 4).
        names: of the coordinates.
        units: of the coordinates.
        locked: joints that stayed, with their positions.
        redundant: joints that took many positions, with their number.
        method: that found them.
        reason: why there is none; "" where there is one.
        rows: the configurations, those near the seed first.
        nearest: the reachable pose next to the wanted one, where there is no configuration.
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
    """The joints that are locked when nothing is said; none up to six joints."""
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
    """Every configuration that takes a frame to a pose, with and without loops.

    Args:
        system: the mechanism.
        T: (4, 4) the pose of the frame seen from the base [m].
        frame: a body, a named frame, the number of a link, or None for the terminal frame.
        method: one of `METHODS`. The general method is for six joints; of another chain "general"
            takes the search.
        seed: a configuration from which distances count and that places joints beside the chain.
        locked: positions of joints that stay, by name; `locked_by_default` when left out, less
            one for each redundant joint.
        redundant: by the name of a joint how many positions it takes, from limit to limit.
        parameters: values of symbols, the others at their defaults.

    Raises:
        ModelError: T is no pose, or a name or method is unknown.
        NoClosedForm: Pieper's or Paul's method does not fit the mechanism.
    """
    name = terminal_frame(system) if frame is None else frame
    many = dict(redundant or {})
    if locked is None:
        held = locked_by_default(system, name, seed)
        for _ in many:  # one less for each
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
    free = [joint for joint in moving_joints(system, frame) if joint not in held]
    return "search" if method == "general" and free and len(free) != SIX else method


def _row(one: Solution, limits: CoordinateLimits) -> Configuration:
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
    """The nearest pose: of the chain alone, else with closed loops, from the seed downhill."""
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
    return tuple(tuple(float(x) for x in row) for row in T)


def _tuple(q: Array) -> tuple[float, ...]:
    return tuple(float(x) for x in q)
