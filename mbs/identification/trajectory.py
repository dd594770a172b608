"""An exciting motion: Fourier series of joints within limits of ranges, rates and efforts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
import numpy.typing as npt
from casadi import DM, MX, SX, Function, cos, mtimes, sin

from mbs.assembly import System
from mbs.assembly.tables import ACCELERATION_UNIT, EFFORT_UNIT
from mbs.errors import ModelError
from mbs.identification.leading import (
    CLEAR,
    active_indices,
    configuration_of,
    is_explicit,
    leads_of,
    of_motion,
    positions,
    signed_leads,
)
from mbs.identification.record import FARTHEST_TURN
from mbs.identification.regressors import Column, regressor
from mbs.models.geometry import transform
from mbs.models.inverse_dynamics import inverse_dynamics
from mbs.numbers import has_boolean
from mbs.result import Result
from mbs.text import did_you_mean, quoted

# Periodic motions of joints as finite Fourier series.


Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class FourierSeries:
    """q(t) = q0 + sum of a_k/(w k) sin(w k t) - b_k/(w k) cos(w k t), with w = 2 pi/period.

    Velocities and accelerations follow without differences, and every period repeats the same
    motion, so that measured periods can be averaged.

    Source: Swevers, Ganseman, Tukel, Schutter & Brussel 1997, eq. 5.

    Attributes:
        period: [s].
        middle: (m,) q0 of each joint [rad or m].
        sine: (m, harmonics) a_k [rad/s or m/s].
        cosine: (m, harmonics) b_k [rad/s or m/s].
    """

    period: float
    middle: Array
    sine: Array
    cosine: Array

    @property
    def harmonics(self) -> int:
        """How many multiples of 1/period the motion has."""
        return int(self.sine.shape[1])

    def q(self, t: npt.ArrayLike) -> Array:
        """(n, m) positions [rad or m] at the instants t (n,) [s], or (m,) at one instant."""
        return self.middle + self._sum(t, 0)

    def v(self, t: npt.ArrayLike) -> Array:
        """(n, m) or (m,) velocities [rad/s or m/s]; see `q`."""
        return self._sum(t, 1)

    def a(self, t: npt.ArrayLike) -> Array:
        """(n, m) or (m,) accelerations [rad/s2 or m/s2]; see `q`."""
        return self._sum(t, 2)

    def law(self, t: SX | MX, order: int = 0) -> SX | MX:
        """(m, 1) positions as an expression, for controllers and motions that are prescribed.

        Args:
            t: symbol of the time [s].
            order: 0 for positions, 1 for velocities, 2 for accelerations.
        """
        w = 2 * np.pi / self.period * np.arange(1, self.harmonics + 1)
        turned = w ** (order - 1)
        a, b = (DM(x * turned) for x in (self.sine, self.cosine))
        angle: Any = DM(w) * t + order * np.pi / 2
        moved: SX | MX = mtimes(a, sin(angle)) - mtimes(b, cos(angle))
        return moved + DM(self.middle) if order == 0 else moved

    def _sum(self, t: npt.ArrayLike, order: int) -> Array:
        if isinstance(t, SX | MX):
            raise ModelError("excitation: the time is a symbol; use law(t), which takes symbols")
        instants = np.asarray(t, dtype=float)
        terms = harmonic_terms(instants.ravel(), self.period, self.harmonics, order)
        values = terms @ np.hstack([self.sine, self.cosine]).T
        return np.asarray(values.reshape(*instants.shape, len(self.middle)), dtype=float)


def harmonic_terms(t: Array, period: float, harmonics: int, order: int) -> Array:
    """(n, 2 harmonics) what multiplies a_1 .. and b_1 .. in a derivative of the series.

    Args:
        t: (n,) instants [s].
        period: [s].
        harmonics: how many.
        order: 0 for q - q0, 1 for the velocity, 2 for the acceleration.
    """
    w = 2 * np.pi / period * np.arange(1, harmonics + 1)
    sin, cos = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    pairs = {0: (sin / w, -cos / w), 1: (cos, sin), 2: (-w * sin, w * cos)}
    return np.hstack(pairs[order])


def resting_coefficients(period: float, harmonics: int) -> Array:
    """(2 harmonics, 2 harmonics - 2) orthonormal coefficients of motions that start at rest.

    Velocity and acceleration are zero at the start and so at the end of every period.

    Args:
        period: [s].
        harmonics: two or more.
    """
    w = np.asarray(2 * np.pi / period * np.arange(1, harmonics + 1), dtype=float)
    # v(0) is the sum of a_k, a(0) that of w_k b_k: each half has one condition of its own
    halves = [_across(condition) for condition in (w**0, w)]
    none = np.zeros((harmonics, harmonics - 1))
    return np.block([[halves[0], none], [none, halves[1]]])


def _across(direction: Array) -> Array:
    """(n, n - 1) orthonormal columns across a direction (n,): a reflection of the axes.

    It is written out, since the basis that a singular value decomposition gives differs from
    processor to processor, and with it every motion that is drawn at random in it.
    """
    unit = direction / np.sqrt(np.sum(direction * direction))
    v = unit.copy()
    v[0] += 1.0
    reflection = np.eye(len(v)) - np.outer(v, v) / v[0]
    across: Array = reflection[:, 1:]
    return across


def between_samples(samples: int, harmonics: int) -> float:
    """Part of a bound that samples must keep so that the series keeps it at every instant.

    A trigonometric polynomial of degree n is nowhere larger than 1/cos(pi n/N) times its largest
    value at N > 2 n equal steps of its period.

    Source: Ehlich & Zeller 1964.
    """
    return float(np.cos(np.pi * harmonics / samples))


# What an exciting motion must keep: ranges of joints, their rates and efforts, and planes.


_SHARE = 0.2
"""Part of `leads` of the assembled configuration that motions keep at least."""

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
    indices = active_indices(system)
    joints = [system.coordinates[k] for k in indices]
    rates = [RATE_UNITS[joint.unit] for joint in joints]
    free: dict[str, Range] = dict.fromkeys((joint.name for joint in joints), None)
    motors = {row.name: row for row in system.speeds}

    def rows(
        quantity: str, bound: Bound, units: Sequence[str], known: Mapping[str, Range] = free
    ) -> tuple[MotionLimit, ...]:
        pairs = _pairs(system, quantity, bound, known)
        return tuple(MotionLimit(quantity, *row) for row in _join(list(known), units, pairs))

    own, others = _positions(system, position, indices)
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
    """The distance from singular configurations; a robot assembled near one may come as near."""
    if not system.is_closed:
        return ()
    least = min(CLEAR, _SHARE * float(leads_of(system, np.array([system.configuration]))[0]))
    return (MotionLimit("leading", system.name, "1", least, np.inf),)


def _positions(
    system: System, bound: Bound, indices: Sequence[int]
) -> tuple[Bound, tuple[tuple[int, MotionLimit], ...]]:
    """Ranges of the independent joints, and limits of the others with their places in q."""
    ranges: dict[str, Range] = {c.name: c.limits for c in system.coordinates}
    known = [c.name for c in system.coordinates if c.unit in RATE_UNITS]
    if isinstance(bound, Mapping):
        _check_names(system, "position", bound, known)
        ranges |= bound
    passive = []
    for k, c in enumerate(system.coordinates):
        if k not in indices and ranges[c.name] is not None:
            lower, upper = _pair(system, "position", ranges[c.name], c.name)
            passive.append((k, MotionLimit("position", c.name, c.unit, lower, upper)))
    if bound is None or isinstance(bound, Mapping):
        bound = [ranges[system.coordinates[k].name] for k in indices]
    return bound, tuple(passive)


def _check_names(system: System, what: str, given: Mapping[str, Any], known: Sequence[str]) -> None:
    for name in given:
        if name not in known:
            raise ModelError(
                f"{system.name}: the {what} names {quoted(name)}, which is none of its joints;"
                f" {did_you_mean(name, known)}"
            )


def _join(
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
    finite = np.isfinite(ends).all() and not has_boolean(value)
    if ends.size > 2 or not lower < upper or not finite:
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


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """A motion of the independent joints that repeats itself and starts at rest.

    Attributes:
        system: that moves.
        columns: parameters that it shows.
        series: of the independent joints.
        condition: condition number of the regressor over one period, in SI units.
        scaled_condition: the same with columns of length one.
        margins: to every limit; of quantities without one, the range that they have.
        objective: what was minimised.
        status: how the search ended.
        steps: of the last search.
    """

    system: System
    columns: tuple[Column, ...]
    series: FourierSeries
    condition: float
    scaled_condition: float
    margins: tuple[Margin, ...]
    objective: str = ""
    status: str = ""
    steps: int = 0

    def __repr__(self) -> str:
        return (
            f"<Trajectory {self.system.name}: {self.series.period:g} s, {len(self.columns)}"
            f" columns, condition {self.condition:.3g}>"
        )

    def q(self, t: npt.ArrayLike) -> Array:
        """(n, m) positions of the independent joints [rad or m] at t (n,) [s], or (m,)."""
        return self.series.q(t)

    def v(self, t: npt.ArrayLike) -> Array:
        """(n, m) or (m,) velocities of the independent joints [rad/s or m/s]."""
        return self.series.v(t)

    def a(self, t: npt.ArrayLike) -> Array:
        """(n, m) or (m,) accelerations of the independent joints [rad/s2 or m/s2]."""
        return self.series.a(t)

    def law(self, t: SX | MX, order: int = 0) -> SX | MX:
        """(m, 1) positions of the independent joints as an expression; see `FourierSeries.law`."""
        return self.series.law(t, order)

    def configuration(self, t: npt.ArrayLike) -> Array:
        """(n, nq) positions of all joints of the tree, which close the loops, or (nq,)."""
        instants = np.asarray(t, dtype=float)
        q = positions(self.system, self.series.q(instants.ravel()))
        return np.asarray(q.reshape(*instants.shape, self.system.nq), dtype=float)

    def table(self, rate: float, periods: int = 1) -> Result:
        """Positions, velocities and accelerations for a controller.

        Args:
            rate: rows in a second [1/s].
            periods: how often the motion is repeated.

        Returns:
            columns such as "j1.q", "j1.v" and "j1.a" of the independent joints; the last row is at
            the end of the last period.

        Raises:
            ModelError: the rate or the number of periods is not positive.
        """
        if not rate > 0 or periods < 1:
            raise ModelError(
                f"trajectory: {rate:g} rows in a second for {periods} periods; give a positive rate"
                " and one period or more"
            )
        span = periods * self.series.period
        time = np.linspace(0.0, span, round(span * rate) + 1)
        values = np.hstack([self.q(time), self.v(time), self.a(time)])
        joints = [self.system.coordinates[k] for k in active_indices(self.system)]
        rates = [RATE_UNITS[joint.unit] for joint in joints]
        units = {f"{joint.name}.q": joint.unit for joint in joints}
        units |= {f"{j.name}.v": unit for j, unit in zip(joints, rates, strict=True)}
        units |= {
            f"{j.name}.a": ACCELERATION_UNIT[unit] for j, unit in zip(joints, rates, strict=True)
        }
        return Result(time, values, units, f"excitation of {self.system.name}")

    def worst(self, quantity: str) -> Margin:
        """The margin of a kind of limit that is smallest as part of its limit.

        Args:
            quantity: position, velocity, acceleration, effort, plane or leading.

        Raises:
            ModelError: no such quantity is limited.
        """
        found = [m for m in self.margins if m.limit.quantity == quantity and m.limit.is_finite]
        if not found:
            raise ModelError(f"trajectory: no {quantity} of {self.system.name} is limited")
        return min(found, key=lambda margin: margin.part)

    def text(self) -> str:
        """Conditions, how the search ended, and the range of every limited quantity."""
        lines = [
            f"{self.system.name}: {self.series.period:g} s, {self.series.harmonics} harmonics,"
            f" {len(self.columns)} columns",
            f"Condition number: {self.condition:.4g}; with columns of length one"
            f" {self.scaled_condition:.4g}",
            f"Objective {self.objective}: {self.status} after {self.steps} steps",
            "quantity      name       lowest    highest      limits                margin",
        ]
        lines += [_line(margin) for margin in self.margins if margin.limit.is_finite]
        return "\n".join(lines)


def _line(margin: Margin) -> str:
    limit = margin.limit
    ends = f"{limit.lower:9.4g} .. {limit.upper:<9.4g}"
    return (
        f"{limit.quantity:<13} {limit.name:<8} {margin.lowest:9.4f} {margin.highest:10.4f}"
        f"   {ends} {margin.worst:9.2g} {limit.unit}"
    )


# Observations and limited quantities of a system at one instant of a motion of its joints.


def instant(system: System, columns: Sequence[Column], limits: MotionLimits) -> Function:
    """``instant(q_a, v_a, a_a) -> D, bounded``: what one instant adds to the observations.

    Positions of the other joints of a closed system follow by its closed form, or by continuation
    from the assembled configuration where it has none.

    Args:
        system: open or closed, at the defaults of its parameters.
        columns: parameters of the system, under any names.
        limits: of which `of_models` are computed.

    Returns:
        Function of (m, 1) positions, velocities and accelerations of the independent joints;
        D (k, m) the columns as rows, bounded (r, 1).

    Raises:
        ModelError: a column is no parameter of the system, or a plane names no frame.
    """
    m = len(system.active)
    q_a, v_a, a_a = (MX.sym(name, m) for name in ("q_a", "v_a", "a_a"))
    q = configuration_of(system, q_a)
    D = of_motion(regressor(system, columns))(q, v_a, a_a)
    bounded = [*_efforts(system, limits, q, v_a, a_a), *(q[k] for k, _ in limits.passive)]
    for plane in limits.planes:
        T = of_motion(transform(system, plane.frame))(q)
        bounded.append(casadi.dot(DM(plane.unit_normal), (T @ DM([*plane.point, 1.0]))[:3]))
    if limits.leading:
        bounded.append(signed_leads(system)(q))
    outputs = [D.T, casadi.vertcat(MX(0, 1), *bounded)]
    names = ["q_a", "v_a", "a_a"], ["D", "bounded"]
    function = Function("instant", [q_a, v_a, a_a], outputs, *names)
    return function.expand() if is_explicit(system) else function


def _efforts(system: System, limits: MotionLimits, q: MX, v_a: MX, a_a: MX) -> list[MX]:
    if not any(limit.is_finite for limit in limits.effort):
        return [MX(0) for _ in limits.effort]
    if system.motors != system.active:
        raise ModelError(
            f"{system.name}: limits of efforts are given and its motors are not its independent"
            " joints, so that they share efforts in many ways; leave the limits of efforts out"
        )
    tau = of_motion(inverse_dynamics(system))(q, v_a, a_a)
    return [tau[k] for k in range(len(limits.effort))]
