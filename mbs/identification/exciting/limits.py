"""What an exciting motion must keep: ranges of joints, their rates and efforts, and planes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from mbs.assembly import System
from mbs.assembly.tables import ACCELERATION_UNIT, EFFORT_UNIT
from mbs.errors import ModelError
from mbs.identification.leading import CLEAR, leads_of
from mbs.identification.postures import active_places
from mbs.identification.records.rules import FARTHEST_TURN
from mbs.messages import did_you_mean, quoted

Array = npt.NDArray[np.float64]

_SHARE = 0.2
"""Part of `leads` of the assembled posture that motions keep at least."""

Range = float | tuple[float, float] | None
"""A number +-, (lower, upper), or None for no limit."""

Bound = float | Sequence[Range] | Mapping[str, Range] | None
"""One number +- for all joints; or a range for each in turn; or ranges by name of the joint."""

RATE_UNITS = {"rad": "rad/s", "m": "m/s"}


@dataclass(frozen=True, slots=True)
class Plane:
    """A point of the robot that must stay on one side of a plane: normal . x >= offset.

    Attributes:
        frame: a body, a named frame, or the number of a link, which carries the point.
        point: the point in this frame [m].
        normal: of the plane in the base frame, towards the side that is allowed; of any length.
        offset: distance of the plane from the origin of the base along the normal [m].
    """

    frame: str | int
    point: tuple[float, float, float]
    normal: tuple[float, float, float]
    offset: float

    def __post_init__(self) -> None:
        numbers = np.array([*self.point, *self.normal, self.offset], dtype=float)
        if numbers.shape != (7,) or not np.isfinite(numbers).all():
            raise ModelError(
                f"plane of {quoted(self.frame)}: point {quoted(self.point)}, normal"
                f" {quoted(self.normal)} and offset {quoted(self.offset)} are no seven finite"
                " numbers; give (x, y, z), (x, y, z) and a distance in m"
            )
        if not any(self.normal):
            raise ModelError(
                f"plane of {quoted(self.frame)}: the normal is zero; give the direction of the side"
                " that is allowed"
            )

    @property
    def unit_normal(self) -> Array:
        """(3,) the normal with length one."""
        normal = np.array(self.normal, dtype=float)
        return np.asarray(normal / np.linalg.norm(normal), dtype=float)


@dataclass(frozen=True, slots=True)
class MotionLimit:
    """The range of one quantity during the motion.

    Attributes:
        quantity: position, velocity, acceleration, effort, plane or leading.
        name: of the coordinate, or of the point's frame.
        unit: of the quantity.
        lower: -inf where there is none.
        upper: inf where there is none.
    """

    quantity: str
    name: str
    unit: str
    lower: float
    upper: float

    @property
    def is_finite(self) -> bool:
        """Whether anything is limited."""
        return bool(np.isfinite(self.lower) or np.isfinite(self.upper))


@dataclass(frozen=True, slots=True)
class Margin:
    """How near a motion comes to a limit.

    Attributes:
        limit: the limit.
        lowest: smallest value of the quantity.
        highest: largest value of the quantity.
    """

    limit: MotionLimit
    lowest: float
    highest: float

    @property
    def worst(self) -> float:
        """Distance to the nearer end of the range, negative outside, in the unit of the limit."""
        return float(min(self.lowest - self.limit.lower, self.limit.upper - self.highest))

    @property
    def part(self) -> float:
        """`worst` as part of the larger end of the range; of one open on a side, in its unit."""
        ends = abs(self.limit.lower), abs(self.limit.upper)
        return self.worst / (max(ends) if np.isfinite(ends).all() else 1.0)


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """The limits of a motion.

    Attributes:
        position: of the m independent joints, always finite.
        velocity: of the same.
        acceleration: of the same.
        effort: of the same.
        passive: positions of the other joints of a closed system, by number of the coordinate.
        planes: of points.
        leading: how well the independent joints of a closed system lead the others.
    """

    position: tuple[MotionLimit, ...]
    velocity: tuple[MotionLimit, ...]
    acceleration: tuple[MotionLimit, ...]
    effort: tuple[MotionLimit, ...]
    passive: tuple[tuple[int, MotionLimit], ...]
    planes: tuple[Plane, ...]
    leading: tuple[MotionLimit, ...] = ()

    @property
    def of_rates(self) -> tuple[MotionLimit, ...]:
        """Of positions, velocities and accelerations, each in the order of the joints."""
        return (*self.position, *self.velocity, *self.acceleration)

    @property
    def of_models(self) -> tuple[MotionLimit, ...]:
        """Of efforts, passive positions, planes and leading, in this order."""
        planes = (
            MotionLimit("plane", str(plane.frame), "m", plane.offset, np.inf)
            for plane in self.planes
        )
        return (*self.effort, *(limit for _, limit in self.passive), *planes, *self.leading)


def limits_of(
    system: System,
    position: Bound = None,
    *,
    velocity: Bound = None,
    acceleration: Bound = None,
    effort: Bound = None,
    planes: Sequence[Plane] = (),
) -> MotionLimits:
    """The limits of a motion of a system, those that its joints describe by default.

    Raises:
        ModelError: a limit has not as many values as there are independent joints, it is empty or
            of no joint, or an independent joint has no range of positions.
    """
    places = active_places(system)
    joints = [system.coordinates[k] for k in places]
    rates = [RATE_UNITS[joint.unit] for joint in joints]
    free: dict[str, Range] = dict.fromkeys((joint.name for joint in joints), None)
    motors = {row.name: row for row in system.speeds}

    def rows(
        quantity: str, bound: Bound, units: Sequence[str], known: Mapping[str, Range] = free
    ) -> tuple[MotionLimit, ...]:
        pairs = _pairs(system, quantity, bound, known)
        return tuple(MotionLimit(quantity, *row) for row in _joined(list(known), units, pairs))

    own, others = _positions(system, position, places)
    positions = rows("position", own, [joint.unit for joint in joints])
    for limit in positions:
        if not (np.isfinite(limit.lower) and np.isfinite(limit.upper)):
            raise ModelError(
                f"{system.name}: joint {limit.name} has no range of positions; give position="
                " with (lower, upper) for each independent joint"
            )
        widest = max(-limit.lower, limit.upper)
        if limit.unit == "rad" and widest > FARTHEST_TURN:
            raise ModelError(
                f"{system.name}: the position of {limit.name} may go to {widest:.4g} rad, more than"
                " two turns of a joint; convert degrees by numpy.radians"
            )
    return MotionLimits(
        positions,
        rows("velocity", velocity, rates, {name: _known(motors[name].limits) for name in free}),
        rows("acceleration", acceleration, [ACCELERATION_UNIT[unit] for unit in rates]),
        rows(
            "effort",
            effort,
            [EFFORT_UNIT[unit] for unit in rates],
            {name: _known(motors[name].effort) for name in free},
        ),
        others,
        tuple(planes),
        _leading(system),
    )


def _known(described: tuple[float, float] | None) -> Range:
    """A range of a description; None where it has no end."""
    return None if described is None or np.isinf(described).all() else described


def _leading(system: System) -> tuple[MotionLimit, ...]:
    """The distance from singular postures; a robot that is assembled near one may come as near."""
    if not system.is_closed:
        return ()
    least = min(CLEAR, _SHARE * float(leads_of(system, np.array([system.posture]))[0]))
    return (MotionLimit("leading", system.name, "1", least, np.inf),)


def _positions(
    system: System, bound: Bound, places: Sequence[int]
) -> tuple[Bound, tuple[tuple[int, MotionLimit], ...]]:
    """Ranges of the independent joints, and limits of the others with their places in q."""
    ranges: dict[str, Range] = {c.name: c.limits for c in system.coordinates}
    known = [c.name for c in system.coordinates if c.unit in RATE_UNITS]
    if isinstance(bound, Mapping):
        _check_names(system, "position", bound, known)
        ranges |= bound
    passive = []
    for k, c in enumerate(system.coordinates):
        if k not in places and ranges[c.name] is not None:
            lower, upper = _pair(system, "position", ranges[c.name], c.name)
            passive.append((k, MotionLimit("position", c.name, c.unit, lower, upper)))
    if bound is None or isinstance(bound, Mapping):
        bound = [ranges[system.coordinates[k].name] for k in places]
    return bound, tuple(passive)


def _check_names(system: System, what: str, given: Mapping[str, Any], known: Sequence[str]) -> None:
    for name in given:
        if name not in known:
            raise ModelError(
                f"{system.name}: the {what} names {quoted(name)}, which is none of its joints;"
                f" {did_you_mean(name, known)}"
            )


def _joined(
    names: Sequence[str], units: Sequence[str], pairs: Sequence[tuple[float, float]]
) -> list[tuple[str, str, float, float]]:
    rows = zip(names, units, pairs, strict=True)
    return [(name, unit, lower, upper) for name, unit, (lower, upper) in rows]


def _pairs(
    system: System, quantity: str, bound: Bound, described: Mapping[str, Range]
) -> list[tuple[float, float]]:
    """(lower, upper) of each joint, as its description has it where it is not given."""
    names = list(described)
    if bound is None or isinstance(bound, Mapping):
        given = bound or {}
        _check_names(system, quantity, given, names)
        bound = [given.get(name, described[name]) for name in names]
    if isinstance(bound, str):
        raise ModelError(
            f"{system.name}: {quantity} is {quoted(bound)}; give a number, a range for each joint,"
            " or a dict by joint"
        )
    values = bound if isinstance(bound, Sequence | np.ndarray) else [bound] * len(names)
    if len(values) != len(names):
        raise ModelError(
            f"{system.name}: {quantity} has {len(values)} limits for {len(names)} independent"
            f" joints: {', '.join(names)}; give one for each"
        )
    return [_pair(system, quantity, x, name) for x, name in zip(values, names, strict=True)]


def _pair(system: System, quantity: str, value: Range, name: str) -> tuple[float, float]:
    if value is None:
        return -np.inf, np.inf
    ends = np.asarray(value, dtype=float).ravel()
    lower, upper = (-ends[0], ends[0]) if ends.size == 1 else (ends[0], ends[-1])
    if ends.size > 2 or not lower < upper or not np.isfinite(ends).all():
        raise ModelError(
            f"{system.name}: the limit of the {quantity} of {name} is {quoted(value)}; give a"
            " positive number, or finite (lower, upper) with lower < upper, or None"
        )
    if quantity in ("velocity", "acceleration") and not lower < 0 < upper:
        raise ModelError(
            f"{system.name}: the {quantity} of {name} is between {lower:g} and {upper:g}; a motion"
            " that starts and ends at rest needs zero inside"
        )
    return float(lower), float(upper)
